/* Pixels of a stack (view, row, bin) round one of them; beyond an end they are mirrored about the last
 * one, which is not repeated: a pixel at the border is no witness of itself. */

static int within(int i, int count) {
  const int last = count - 1, from_first = i < 0 ? -i : i;
  const int inside = from_first > last ? 2 * last - from_first : from_first;
  return inside < 0 ? 0 : inside > last ? last : inside;
}

/* LANES neighbouring bins of a row of projections from `bin` on. */
static lanes bins_from(__global const float *row, int bin, int bins) {
#if LANES == 8
  if (bin >= 0 && bin + LANES <= bins) return LOAD(row + bin);
  float8 found;
  found.s0 = row[within(bin, bins)];
  found.s1 = row[within(bin + 1, bins)];
  found.s2 = row[within(bin + 2, bins)];
  found.s3 = row[within(bin + 3, bins)];
  found.s4 = row[within(bin + 4, bins)];
  found.s5 = row[within(bin + 5, bins)];
  found.s6 = row[within(bin + 6, bins)];
  found.s7 = row[within(bin + 7, bins)];
  return found;
#else
  return row[within(bin, bins)];
#endif
}
