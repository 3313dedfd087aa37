/* The samples of a ray that may reach a tile: where it enters and leaves, and a sample more. */

typedef struct { int first, last; } span;

/* `visit` is where the ray meets the tile's first cell, `inverse` the samples from cell to cell, and
 * `kept` how many samples the ray has on either side of zero, zero included. Nothing is reached
 * where last < first. */
static span samples_near(int4 visit, float2 inverse, int kept) {
  const float low_x = visit.x - 0.5f * WIDTH, high_x = low_x + (TILE + WIDTH);
  const float low_y = visit.y - 0.5f * WIDTH, high_y = low_y + (TILE + WIDTH);
  const float ax = low_x * inverse.x, bx = high_x * inverse.x;
  const float ay = low_y * inverse.y, by = high_y * inverse.y;
  const float near_y = ay < by ? ay : by, far_y = ay < by ? by : ay;
  float enter = ax > near_y ? ax : near_y, leave = bx < far_y ? bx : far_y;
  if (enter < (float)-kept) enter = (float)-kept;
  if (leave > (float)kept) leave = (float)kept;
  span s = {0, -1};
  if (enter > leave) return s;
  s.first = (int)enter - 1 > -kept ? (int)enter - 1 : 1 - kept;
  s.last = (int)leave + 1 < kept ? (int)leave + 1 : kept - 1;
  return s;
}

/* Whether a kernel from a cell on reaches into the tile. */
#define REACHES(x, y) ((x) > -WIDTH && (x) < TILE && (y) > -WIDTH && (y) < TILE)
