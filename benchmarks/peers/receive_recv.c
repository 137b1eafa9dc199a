/* `c`: one recv system call per frame. */
#include "peer.h"

int peer_open(unsigned interface_index) {
    int raw = socket(AF_PACKET, SOCK_RAW, htons(ETHERCAT));
    if (raw < 0) fail("socket");
    struct sockaddr_ll address = {.sll_family = AF_PACKET,
                                  .sll_protocol = htons(ETHERCAT),
                                  .sll_ifindex = (int)interface_index};
    if (bind(raw, (struct sockaddr *)&address, sizeof address)) fail("bind");
    return raw;
}

unsigned peer_receive(int raw, uint8_t *frame) {
    ssize_t length = recv(raw, frame, FRAME_MAX, MSG_DONTWAIT);
    return length > 0 ? (unsigned)length : 0;
}
