/* `c-ring`: frames arrive in memory mapped from the kernel (PACKET_MMAP, TPACKET_V2), so receiving
 * needs no system call. Sending bypasses the queueing discipline. */
#include "peer.h"

#include <sys/mman.h>

#define SLOT_SIZE 2048
#define SLOTS 64

static uint8_t *ring;
static unsigned slot;

int peer_open(unsigned interface_index) {
    int raw = socket(AF_PACKET, SOCK_RAW, 0);
    int version = TPACKET_V2, on = 1;
    struct tpacket_req layout = {.tp_block_size = SLOT_SIZE * SLOTS,
                                 .tp_block_nr = 1,
                                 .tp_frame_size = SLOT_SIZE,
                                 .tp_frame_nr = SLOTS};
    if (raw < 0) fail("socket");
    if (setsockopt(raw, SOL_PACKET, PACKET_VERSION, &version, sizeof version)) fail("TPACKET_V2");
    if (setsockopt(raw, SOL_PACKET, PACKET_QDISC_BYPASS, &on, sizeof on)) fail("QDISC_BYPASS");
    if (setsockopt(raw, SOL_PACKET, PACKET_RX_RING, &layout, sizeof layout)) fail("RX_RING");
    ring = mmap(NULL, SLOT_SIZE * SLOTS, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_LOCKED, raw, 0);
    if (ring == MAP_FAILED) fail("mmap");
    struct sockaddr_ll address = {.sll_family = AF_PACKET,
                                  .sll_protocol = htons(ETHERCAT),
                                  .sll_ifindex = (int)interface_index};
    if (bind(raw, (struct sockaddr *)&address, sizeof address)) fail("bind");
    return raw;
}

unsigned peer_receive(int raw, uint8_t *frame) {
    struct tpacket2_hdr *header = (struct tpacket2_hdr *)(ring + slot * SLOT_SIZE);
    (void)raw;
    if (!(__atomic_load_n(&header->tp_status, __ATOMIC_ACQUIRE) & TP_STATUS_USER)) return 0;
    unsigned length = header->tp_snaplen < FRAME_MAX ? header->tp_snaplen : FRAME_MAX;
    memcpy(frame, (uint8_t *)header + header->tp_mac, length);
    __atomic_store_n(&header->tp_status, TP_STATUS_KERNEL, __ATOMIC_RELEASE);
    slot = (slot + 1) % SLOTS;
    return length;
}
