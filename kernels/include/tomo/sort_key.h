/* Floats as whole numbers of the same order: negative ones turned over, the others above them.
 * The two zeros are one value. */

static uint key_of(float value) {
  const uint bits = as_uint(value), plain = bits == 0x80000000u ? 0u : bits;
  return plain ^ (plain >> 31 ? 0xffffffffu : 0x80000000u);
}

static float value_of(uint key) {
  return as_float(key ^ (key >> 31 ? 0x80000000u : 0xffffffffu));
}
