/* The rectangle of tiles that a splat may touch: (x0, y0, x1, y1), the end not included.
 *
 * Boxes are cut to the image's tiles, so that no box can lead outside the lists. A tile's number
 * is its row times the tiles in a row plus its column. */

static int4 clipped_box(int4 box, int tiles_x, int tiles_y) {
  box.x = box.x > 0 ? box.x : 0;
  box.y = box.y > 0 ? box.y : 0;
  box.z = box.z < tiles_x ? box.z : tiles_x;
  box.w = box.w < tiles_y ? box.w : tiles_y;
  return box;
}
