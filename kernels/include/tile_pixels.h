/* The pixels of one tile as a CPU's work-item holds them: in strips of LANES columns, row by row.
 *
 * For compositing a pixel's state is its transmittance and CHANNELS sums; a finished pixel has the
 * sign of its transmittance turned. On the way back it is T, the colour q that lies behind, and v =
 * dL/dC. `end` is where a pixel's list of entries was left. An image has `stride` channels, of
 * which CHANNELS from `first` on are looked at. Include alpha.h before it. */

#define STRIPS (TILE / LANES)
#define PIXELS (STRIPS * TILE)
/* Splats between two looks at whether the tile is finished. */
#define PATIENCE 16
/* Splats are asked for so many entries before they are needed: they lie anywhere in memory. */
#define AHEAD 8
#define SIGN_BIT ((int)0x80000000)

static int any_negative(lanes_int v) {
#if LANES == 8
  const int4 four = v.lo | v.hi;
  const int2 two = four.lo | four.hi;
  return (two.x | two.y) < 0;
#else
  return v < 0;
#endif
}

static int all_negative(lanes (*state)[1 + CHANNELS]) {
  lanes_int sign = AS_INT(state[0][0]);
  for (int p = 1; p < PIXELS; p++) sign &= AS_INT(state[p][0]);
  return !any_negative(~sign);
}

/* Pixels that nothing hides yet, whose entries end at `stop`. */
static void clear_pixels(lanes (*state)[1 + CHANNELS], lanes_int *end, int stop) {
  for (int p = 0; p < PIXELS; p++) {
    state[p][0] = 1;
    end[p] = stop;
    for (int n = 0; n < CHANNELS; n++) state[p][1 + n] = 0;
  }
}

/* Note the entry at which pixels of a strip's rows were finished. */
static void note_finished(
    lanes (*state)[1 + CHANNELS], lanes_int *end, int strip, TileSplat s, int stop, int entry)
{
  for (int p = strip * TILE + s.top; p < strip * TILE + s.bottom; p++)
    end[p] = state[p][0] < 0 && end[p] == stop ? entry : end[p];
}

/* Write the pixels of a tile whose corner is (x0, y0) and whose entries begin at `start`. */
static void write_pixels(
    lanes (*state)[1 + CHANNELS], lanes_int *end, int start, int x0, int y0,
    int height, int width, int stride, int first, __global const float *background,
    __global float *image, __global float *transmittance, __global int *last)
{
  for (int p = 0; p < PIXELS; p++) {
    const int y = y0 + p % TILE, x = x0 + p / TILE * LANES;
    for (int lane = 0; lane < LANES && x + lane < width && y < height; lane++) {
      const long pixel = (long)y * width + x + lane;
      const float t = ((const float *)&state[p][0])[lane], rest = t < 0 ? -t : t;
      transmittance[pixel] = rest;
      last[pixel] = ((const int *)&end[p])[lane] - start;
      for (int n = 0; n < CHANNELS; n++)
        image[pixel * stride + first + n] =
            ((const float *)&state[p][1 + n])[lane] + (ADDITIVE ? 0 : rest * background[first + n]);
    }
  }
}

/* Read them for the way back; where the deepest of the pixels was left is returned. */
static int read_pixels(
    lanes (*state)[2 + CHANNELS], lanes_int *end, int start, int x0, int y0, int height, int width,
    int stride, int first, __global const float *background, __global const float *grad_image,
    __global const float *grad_transmittance, __global const float *transmittance,
    __global const int *last)
{
  int deepest = start;
  for (int p = 0; p < PIXELS; p++) {
    const int y = y0 + p % TILE, x = x0 + p / TILE * LANES;
    for (int lane = 0; lane < LANES; lane++) {
      const int inside = x + lane < width && y < height;
      const long pixel = inside ? (long)y * width + x + lane : 0;
      float q = inside ? grad_transmittance[pixel] : 0;
      for (int n = 0; n < CHANNELS; n++) {
        const float g = inside ? grad_image[pixel * stride + first + n] : 0;
        ((float *)&state[p][2 + n])[lane] = g;
        q += g * background[first + n];
      }
      const int stop = inside ? last[pixel] + start : 0;
      ((float *)&state[p][0])[lane] = inside ? transmittance[pixel] : 1;
      ((float *)&state[p][1])[lane] = q;
      ((int *)&end[p])[lane] = stop;
      deepest = stop > deepest ? stop : deepest;
    }
  }
  return deepest;
}
