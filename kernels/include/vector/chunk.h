/* How a list is cut into chunks, one to a work-item of a CPU or to a group of a GPU, in the order of
 * the list.
 *
 * Chunk c of n takes elements [CHUNK_BEGIN(c), CHUNK_BEGIN(c + 1)): as even as can be, for any
 * number of elements, also one that only the device knows. Since a chunk is gone through in order
 * and the chunks are numbered in order, counting and then placing by chunks is stable, and no two
 * chunks ever write to one place: nothing here needs an atomic. */

#define CHUNK_BEGIN(chunk, chunks, count) ((int)((long)(count) * (chunk) / (chunks)))
