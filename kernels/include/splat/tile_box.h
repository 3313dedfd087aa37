/* The rectangle of tiles that a splat may touch: (x0, y0, x1, y1), the end not included.
 *
 * Boxes are cut to the tiles_y rows of tiles from first_tile_row on, so that no box can lead outside
 * the lists, and counted from there: a tile's number is its row times the tiles in a row plus its
 * column. */

static int4 clipped_box(int4 box, int tiles_x, int first_tile_row, int tiles_y) {
  box.x = box.x > 0 ? box.x : 0;
  box.y = box.y > first_tile_row ? box.y - first_tile_row : 0;
  box.z = box.z < tiles_x ? box.z : tiles_x;
  box.w = box.w > first_tile_row ? box.w - first_tile_row : 0;
  box.w = box.w < tiles_y ? box.w : tiles_y;
  return box;
}
