/* The functions of catenary_share.h, for your program or as a shared library:
 *
 *     cc -O2 -pthread -shared -fPIC $(catenary include)/catenary_share.c -o libcatenary_share.so
 */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#define CATENARY_SHARE_IMPLEMENTATION
#include "catenary_share.h"
