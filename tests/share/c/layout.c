/* Print the sizes and offsets of the structures in catenary_share.h as a JSON object. */
#define _GNU_SOURCE
#define CATENARY_SHARE_IMPLEMENTATION
#include "catenary_share.h"

#define FIELD(type, name) printf("\"" #type "." #name "\": %zu, ", offsetof(type, name))

static void print_parts(uint32_t axes) {
    cat_desk_parts p = cat_desk_parts_of(axes);
    printf("\"parts %u\": [%llu, %llu, %llu, %llu, %llu, %llu, %llu], ", axes, (unsigned long long)p.closed,
           (unsigned long long)p.holders, (unsigned long long)p.places, (unsigned long long)p.rings,
           (unsigned long long)p.ring_size, (unsigned long long)p.motion, (unsigned long long)p.size);
    printf("\"row %u\": %zu, ", axes, cat_desk_row_size(axes));
}

int main(void) {
    printf("{");
    FIELD(cat_desk_place, lease);
    FIELD(cat_desk_place, ended);
    FIELD(cat_desk_place, taken);
    FIELD(cat_desk_place, deadline_ns);
    FIELD(cat_desk_place, last);
    FIELD(cat_desk_place, reason);
    FIELD(cat_desk_place, start_time);
    FIELD(cat_desk_place, pid);
    FIELD(cat_desk_place, command);
    FIELD(cat_motion, stop);
    FIELD(cat_motion, stopper);
    print_parts(0);
    print_parts(1);
    print_parts(33);
    printf("\"sizes\": [%zu, %zu, %zu, %zu], ", sizeof(cat_share_head), sizeof(cat_desk_head),
           sizeof(cat_desk_place), sizeof(cat_motion));
    printf("\"limits\": [%d, %d, %d], ", CAT_SHARE_VERSION, CAT_DESK_PLACES, CAT_DESK_COMMANDS);
    printf("\"magic\": [\"%s\", \"%s\"], ", CAT_SHARE_MAGIC, CAT_DESK_MAGIC);
    printf("\"reasons\": [%d, %d, %d, %d]}\n", CAT_RELEASED, CAT_EXPIRED, CAT_DIED, CAT_LOOP_ENDED);
    return 0;
}
