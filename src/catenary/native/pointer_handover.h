/* Hand-over of a pointer from one owner thread to one user thread. The owner can check whether the
 * user still uses the pointer.
 *
 * offered  the pointer that the owner offers; NULL: none
 * claimed  the pointer that the user has in use; NULL: none
 *
 * Each is one atomic word, so that a pointer is never paired with the state of another one. The
 * user claims a pointer before it reads the object, and checks afterwards that it is still offered
 * (a hazard pointer: Michael, IEEE TPDS 15(6), 2004). The owner keeps an
 * offered or claimed object alive.
 * Offers, claims and checks use sequentially consistent order: each side stores one word, then
 * loads the other.
 *
 * Two uses: `claim` reads a pointer that stays offered. `take` removes a request from the word, so
 * that each request is served at most once and the newest one replaces older ones.
 */
#ifndef CATENARY_POINTER_HANDOVER_H
#define CATENARY_POINTER_HANDOVER_H

#include <stdint.h>

#define CAT_POINTER_NONE ((void *)1)  /* a request for no object, different from no request */

typedef struct cat_pointer {
    void *offered;
    void *claimed;
} cat_pointer;

/* Owner: offer `pointer`. Return the former offer, NULL if `take` has removed it. */
static inline void *cat_pointer_offer(cat_pointer *p, void *pointer) {
    return __atomic_exchange_n(&p->offered, pointer, __ATOMIC_SEQ_CST);
}

/* Owner: return 1 if the user has `pointer` or may still get it. `offered` is read first, because a
 * request only moves from `offered` to `claimed`. */
static inline int cat_pointer_is_used(const cat_pointer *p, const void *pointer) {
    return __atomic_load_n(&p->offered, __ATOMIC_SEQ_CST) == pointer
        || __atomic_load_n(&p->claimed, __ATOMIC_SEQ_CST) == pointer;
}

/* User: return 1 if something is offered. */
static inline int cat_pointer_is_offered(const cat_pointer *p) {
    return __atomic_load_n(&p->offered, __ATOMIC_ACQUIRE) != 0;
}

/* User: return the offered pointer, or NULL. It is valid until `release`, the next `claim` or
 * `take`. */
static inline void *cat_pointer_claim(cat_pointer *p) {
    void *pointer = __atomic_load_n(&p->offered, __ATOMIC_SEQ_CST);
    for (;;) {
        __atomic_store_n(&p->claimed, pointer, __ATOMIC_SEQ_CST);
        void *again = __atomic_load_n(&p->offered, __ATOMIC_SEQ_CST);
        if (again == pointer) return pointer;
        pointer = again;
    }
}

/* User: remove the request. Return 0 if there is none. Return 1 otherwise: *pointer is the requested
 * object, claimed until `release` or the next `take`, or NULL for CAT_POINTER_NONE. */
static inline int cat_pointer_take(cat_pointer *p, void **pointer) {
    void *offered = __atomic_load_n(&p->offered, __ATOMIC_SEQ_CST);
    do {
        if (!offered) return 0;
        __atomic_store_n(&p->claimed, offered == CAT_POINTER_NONE ? 0 : offered, __ATOMIC_SEQ_CST);
    } while (!__atomic_compare_exchange_n(&p->offered, &offered, 0, 0, __ATOMIC_SEQ_CST,
                                          __ATOMIC_SEQ_CST));
    *pointer = offered == CAT_POINTER_NONE ? 0 : offered;
    return 1;
}

/* User: release the claimed pointer. */
static inline void cat_pointer_release(cat_pointer *p) {
    __atomic_store_n(&p->claimed, 0, __ATOMIC_RELEASE);
}

#endif
