/* The device's multiply-add rate: CHAINS independent chains of x = x * a + b in every work-item.
 *
 * `lanes` are eight floats on a CPU and one on a GPU, as in our kernels, so that the limit is the
 * one that those could reach. No built-in functions: on PoCL 3.0 they are calls. */

#if LANES == 8
typedef float8 lanes;
#else
typedef float lanes;
#endif
#define UNROLL _Pragma("unroll")

__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void multiply_add(__global lanes *out, float a, float b, int rounds)
{
  const int item = (int)get_global_id(0);
  lanes x[CHAINS];
  UNROLL for (int c = 0; c < CHAINS; c++) x[c] = (float)(item + c);
  for (int round = 0; round < rounds; round++) {
    UNROLL for (int link = 0; link < LINKS; link++) {
      UNROLL for (int c = 0; c < CHAINS; c++) x[c] = x[c] * a + b;
    }
  }
  lanes sum = 0;
  UNROLL for (int c = 0; c < CHAINS; c++) sum = sum + x[c];
  out[item] = sum;
}
