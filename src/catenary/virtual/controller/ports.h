/* Ports: light, link, loop control and their registers (ET1100 datasheet, section I chapter 3, and
 * section II 0x0101, 0x0110, 0x0310).
 *
 * A cable carries light while it is plugged in and both sides have power. A controller detects the
 * loss of light after the time `detection`. It then closes the loop, unless DL control holds the loop
 * open. Until then, it sends frames into the dark cable. New light establishes a link immediately. */
#ifndef CATENARY_VIRTUAL_PORTS_H
#define CATENARY_VIRTUAL_PORTS_H

#include "controller/controller.h"
#include "watchdog.h"

enum loop_mode { LOOP_AUTO = 0, LOOP_AUTO_CLOSE = 1, LOOP_OPEN = 2, LOOP_CLOSED = 3 };

#define TEMPORARY_USE_NS 1000000000

static inline int loop_mode_of(const controller *c, int p) {
    return c->fixed_loops ? LOOP_AUTO : c->memory[REG_DL_CONTROL + 1] >> (2 * p) & 3;
}

/* Update DL status: links in bits 4 to 7; from bit 8 on, loop closed and communication of each port.
 * Set the event bit if the status has changed, and mark the routes as stale. */
static void ports_show(controller *c) {
    uint8_t *status = c->memory + REG_DL_STATUS;
    uint8_t links = 0, loops = 0;
    for (int p = 0; p < PORTS; p++) {
        const port *q = &c->ports[p];
        links |= (uint8_t)(q->link ? 0x10 << p : 0);
        loops |= (uint8_t)((q->closed ? 1 : 0) << (2 * p));
        loops |= (uint8_t)((q->link && !q->closed ? 2 : 0) << (2 * p));
    }
    if (((status[0] ^ links) & 0xF0) || status[1] != loops)
        store16(c->memory + REG_ECAT_EVENT, load16(c->memory + REG_ECAT_EVENT) | ECAT_EVENT_DL_STATUS);
    status[0] = (uint8_t)((status[0] & 0x0F) | links);
    status[1] = loops;
    c->segment->routes_stale = 1;
}

/* Set the loops according to mode and link. `written`: DL control has just been written, which opens
 * an auto-closed port with a link. */
static void loops_set(controller *c, int written) {
    int open = 0;
    for (int p = 0; p < PORTS; p++) {
        port *q = &c->ports[p];
        int mode = loop_mode_of(c, p);
        if (!q->exists || mode == LOOP_CLOSED)
            q->closed = 1;
        else if (mode == LOOP_OPEN)
            q->closed = 0;
        else if (!q->link)
            q->closed = 1;
        else if (mode == LOOP_AUTO || written)
            q->closed = 0;
        open += !q->closed;
    }
    if (open == 0)
        c->ports[0].closed = 0;        /* port 0 is open if all others are closed */
    ports_show(c);
}

/* Open the auto-closed port at which a valid frame has arrived. */
static void loop_opened_by_frame(controller *c, int p) {
    c->ports[p].closed = 0;
    ports_show(c);
}

static inline void links_due_at(cat_segment *s, int64_t when) {
    s->link_due = when < s->link_due ? when : s->link_due;
    s->next_due = when < s->next_due ? when : s->next_due;
}

static void loop_control_written(controller *c, uint8_t before) {
    if (!(c->memory[REG_DL_CONTROL] & DL_CONTROL_TEMPORARY))
        c->loops_due = NEVER;
    else {
        if (c->loops_due == NEVER)
            c->loops_before = before;
        c->loops_due = c->segment->now + TEMPORARY_USE_NS;
        links_due_at(c->segment, c->loops_due);
    }
    loops_set(c, 1);
}

static void port_sees_light(controller *c, int p, int light) {
    port *q = &c->ports[p];
    q->loss_due = light || !q->link ? NEVER : c->segment->now + c->segment->detection;
    if (light && !q->link) {
        q->link = 1;
        loops_set(c, 0);
    }
    links_due_at(c->segment, q->loss_due);
}

static void port_loses_link(controller *c, int p) {
    c->ports[p].loss_due = NEVER;
    c->ports[p].link = 0;
    count_up(c->memory + REG_LOST_LINKS + p);
    loops_set(c, 0);
}

/* Handle due detections of lost links, and the end of temporary loop settings. */
static void links_check(cat_segment *s) {
    s->link_due = NEVER;
    for (int n = 0; n < s->count; n++) {
        controller *c = &s->controllers[n];
        if (!c->powered)
            continue;
        for (int p = 0; p < PORTS; p++) {
            if (c->ports[p].loss_due <= s->now)
                port_loses_link(c, p);
            links_due_at(s, c->ports[p].loss_due);
        }
        if (c->loops_due <= s->now) {
            c->loops_due = NEVER;
            c->memory[REG_DL_CONTROL] &= (uint8_t)~DL_CONTROL_TEMPORARY;
            c->memory[REG_DL_CONTROL + 1] = c->loops_before;
            loops_set(c, 1);
        }
        links_due_at(s, c->loops_due);
    }
}

static inline int end_has_power(const cat_segment *s, cable_end e) {
    return e.device < 0 ? s->ends[END_FIRST - e.device].up : s->controllers[e.device].powered;
}

static void end_sees_light(cat_segment *s, cable_end e, int light) {
    if (e.device >= 0 && s->controllers[e.device].powered)
        port_sees_light(&s->controllers[e.device], e.port, light);
}

/* Handle changes of cables and power. Return 1 if a cable has become dark. */
static int light_update(cat_segment *s) {
    int darker = 0;
    s->routes_stale = 1;
    for (int n = 0; n < s->cable_count; n++) {
        cable *k = &s->cables[n];
        int light = k->plugged && end_has_power(s, k->up) && end_has_power(s, k->down);
        darker |= k->light && !light;
        if (light == k->light)
            continue;
        k->light = (uint8_t)light;
        end_sees_light(s, k->up, light);
        end_sees_light(s, k->down, light);
    }
    return darker;
}

/* Reset the ports: no link is detected, and all loops are closed. */
static void ports_reset(controller *c) {
    for (int p = 0; p < PORTS; p++) {
        c->ports[p].link = 0;
        c->ports[p].closed = 1;
        c->ports[p].loss_due = NEVER;
    }
    c->loops_due = NEVER;
}

#endif
