/* The whole numbers that a scan goes through: of 32 bits, or with WIDE 1 of 64, which sums have. */

#ifndef WIDE
#define WIDE 0
#endif
#if WIDE
typedef long number;
#else
typedef int number;
#endif
