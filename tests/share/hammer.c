/* A cycle that does nothing but give itself to its sink, as fast as it can. */
#include <stdint.h>

#include "sink.h"

void hammer_sink(const cat_sink *sink, uint64_t first, uint64_t count) {
    uint64_t blocks[3][256];
    for (uint64_t number = first; number < first + count; number++) {
        for (unsigned block = 0; block < 3; block++)
            for (unsigned word = 0; word < 256; word++) blocks[block][word] = number;
        sink->put(sink->self, number, blocks[0], blocks[1], blocks[2]);
    }
}
