/* Sums over the items of a group (Hillis and Steele): log2(GROUP) steps, each item adding what the
 * one `step` before it holds. */

/* The sum of what items before give; `all` becomes the sum of everyone's. Every item of a group calls
 * it, with GROUP sums in local memory. */
static long sum_before(__local long *sums, int item, long value, long *all) {
  sums[item] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int step = 1; step < GROUP; step *= 2) {
    const long more = item >= step ? sums[item - step] : 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    sums[item] += more;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  const long before = sums[item] - value;
  *all = sums[GROUP - 1];
  barrier(CLK_LOCAL_MEM_FENCE);
  return before;
}
