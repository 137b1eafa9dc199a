/* Route of a frame through the controllers, in the present state of loops and light (ET1100
 * datasheet, section I, 3.2 to 3.5): 0 → processing unit → 3, 3 → 1, 1 → 2, 2 → 0. A closed or
 * missing port forwards the frame to the next port. The processing unit follows port 0: it processes
 * frames that arrive at port 0, and frames that a closed loop at port 0 forwards. In a closed ring,
 * a frame from the second interface passes all devices without being processed. At a break, it turns
 * around and is processed on its way back.
 *
 * Routes are computed when something changes, not for each frame. */
#ifndef CATENARY_VIRTUAL_ROUTE_H
#define CATENARY_VIRTUAL_ROUTE_H

#include "controller/ports.h"

enum {
    FORWARDING_NS = 300,               /* delay of a controller without its processing unit */
    PROCESSING_NS = 40,                /* additional delay of the processing unit */
    CABLE_NS = 50                      /* delay of a cable of about ten metres */
};

static const uint8_t NEXT_PORT[PORTS] = {3, 2, 0, 1};

static inline uint32_t route_room(const cat_segment *s) { return 2 * (uint32_t)s->count + 2; }

/* Pass the processing unit. Return 0 if the frame has already circulated and must be destroyed. */
static int route_process(route *r, controller *c, int64_t offset, int turned, uint32_t room) {
    if (turned && loop_mode_of(c, 0) < LOOP_OPEN) {
        if (r->circulates)
            return 0;
        r->circulates = r->stop_count + 1;
    }
    if (r->stop_count == room)
        return 0;                      /* in a manually closed loop, the frame would circulate without end */
    r->stops[r->stop_count].controller = c;
    r->stops[r->stop_count++].offset = offset;
    return 1;
}

/* Enter at port p. Return the port through which the frame leaves, or -1 if it is destroyed. Add the
 * delay to *offset. */
static int route_through(route *r, controller *c, int p, int64_t *offset, uint32_t room) {
    for (int turned = 0;; turned = 1) {
        if (p == 0) {
            if (!route_process(r, c, *offset, turned, room))
                return -1;
            *offset += PROCESSING_NS;
        }
        p = NEXT_PORT[p];
        if (!c->ports[p].closed)
            return p;
    }
}

static void route_make(cat_segment *s, int from) {
    route *r = &s->routes[from];
    uint32_t room = route_room(s);
    int out = from == 0 ? 0 : s->cable_count - 1;
    int64_t offset = 0;
    r->stop_count = r->arrival_count = r->circulates = 0;
    r->opens = -1;
    for (int k = 0; k < PORTS * s->count; k++)
        r->times[k] = NEVER;
    cable_end at = {from == 0 ? END_FIRST : END_SECOND, 0};
    r->exit = -LOSS_NO_LIGHT;
    while (out >= 0 && out < s->cable_count && s->cables[out].light && r->arrival_count < 4 * room) {
        const cable *k = &s->cables[out];
        at = k->up.device == at.device && k->up.port == at.port ? k->down : k->up;
        offset += k->delay;
        r->arrivals[r->arrival_count++] = (arrival){at.device, at.port, out, r->stop_count, offset};
        if (at.device < 0) {
            r->exit = at.device == END_FIRST ? 0 : 1;
            break;
        }
        controller *c = &s->controllers[at.device];
        if (c->ports[at.port].closed) {
            r->exit = -LOSS_CLOSED_PORT;
            if (loop_mode_of(c, at.port) == LOOP_AUTO_CLOSE)
                r->opens = PORTS * at.device + at.port;
            break;
        }
        if (r->times[PORTS * at.device + at.port] == NEVER)
            r->times[PORTS * at.device + at.port] = offset;
        at.port = route_through(r, c, at.port, &offset, room);
        if (at.port < 0) {
            r->exit = -LOSS_CIRCULATING;
            break;
        }
        offset += FORWARDING_NS;
        out = c->ports[at.port].cable;
    }
    r->delay = offset;
}

static inline void routes_refresh(cat_segment *s) {
    if (!s->routes_stale)
        return;
    s->routes_stale = 0;
    route_make(s, 0);
    if (s->ring)
        route_make(s, 1);
}

#endif
