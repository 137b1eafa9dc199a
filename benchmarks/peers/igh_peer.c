/* One cycle over libethercat in a plain C program: the same calls, without tables or checks. */
#include <stdint.h>
#include <string.h>

struct igh_peer {
    void (*receive)(void *), (*send)(void *), (*process)(void *), (*queue)(void *);
    void (*domain_state)(void *, void *), (*master_state)(void *, void *);
    void *master, *domain;
    uint8_t *data, *outputs, *inputs;
    uint32_t output_count, input_count;
    const uint32_t *output_copies, *input_copies;   /* offset in the domain, in the image, size */
};

void igh_peer_cycles(struct igh_peer *p, uint64_t count)
{
    uint32_t domain_state[3], master_state[2], k;
    const uint32_t *copy;
    while (count--) {
        p->receive(p->master);
        p->process(p->domain);
        p->domain_state(p->domain, domain_state);
        p->master_state(p->master, master_state);
        for (k = 0, copy = p->input_copies; k < p->input_count; k++, copy += 3)
            memcpy(p->inputs + copy[1], p->data + copy[0], copy[2]);
        for (k = 0, copy = p->output_copies; k < p->output_count; k++, copy += 3)
            memcpy(p->data + copy[0], p->outputs + copy[1], copy[2]);
        p->queue(p->domain);
        p->send(p->master);
    }
}
