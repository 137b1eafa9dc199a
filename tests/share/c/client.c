/* Programs for the tests of catenary_share.h: C11 and C++17.
 *
 *     client open NAME ...         open each share; print the code and the text
 *     client command NAME          open a share and send a command; print both codes
 *     client hold NAME AXIS        move an axis forward until the process is killed
 *     client follow NAME           read until no more cycles come; print the code
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "catenary_share.h"

static int report(int code, const catenary_error *error) {
    printf("%d %s\n", code, code ? error->text : "");
    fflush(stdout);
    return code != 0;
}

static int open_all(int count, char **names) {
    catenary_error error;
    int k;
    for (k = 0; k < count; k++) {
        catenary_share *share;
        int code = catenary_open(&share, names[k], CATENARY_OWN_UID, CATENARY_STALE, &error);
        if (code == 0) {
            size_t size = catenary_row_size(share);
            char *row = (char *)malloc(size);
            code = catenary_read(share, row, size, NULL, &error);
            free(row);
        }
        catenary_close(share);
        report(code, &error);
    }
    return 0;
}

static int hold(const char *name, uint32_t axis) {
    catenary_share *share;
    catenary_lease *lease;
    catenary_error error;
    double position = 0.0;
    int is_moving = 0, code = catenary_open(&share, name, CATENARY_OWN_UID, 0, &error);
    if (!code) code = catenary_lease_take(share, &axis, 1, 3600.0, &lease, &error);
    while (!code) {
        position += 1e-5;
        code = catenary_lease_send(lease, &position, NULL, NULL, &error);
        if (!code && catenary_wait(share, catenary_newest(share), 10.0, &error) < 0) break;
        if (!is_moving && position > 0.01) {
            is_moving = 1;
            report(0, NULL);
        }
    }
    return report(code, &error);
}

static int command(const char *name) {
    catenary_share *share;
    catenary_lease *lease;
    catenary_error error;
    const uint32_t axis = 0;
    const double position = 0.0;
    int code = catenary_open(&share, name, CATENARY_OWN_UID, 0, &error);
    if (report(code, &error)) return 0;
    code = catenary_lease_take(share, &axis, 1, 600.0, &lease, &error);
    if (!code) code = catenary_lease_send(lease, &position, NULL, NULL, &error);
    report(code, &error);
    catenary_lease_release(lease, NULL);
    catenary_close(share);
    return 0;
}

static int follow(const char *name) {
    catenary_share *share;
    catenary_error error;
    uint64_t seen = 0;
    int code = catenary_open(&share, name, CATENARY_OWN_UID, 0, &error);
    report(code, &error);
    if (code) return 1;
    while ((code = catenary_wait(share, seen, 60.0, &error)) == 1) seen = catenary_newest(share);
    printf("%d %d %s\n", code, catenary_state(share), error.text);
    catenary_close(share);
    return 0;
}

int main(int count, char **words) {
    if (count > 2 && strcmp(words[1], "open") == 0) return open_all(count - 2, words + 2);
    if (count == 3 && strcmp(words[1], "command") == 0) return command(words[2]);
    if (count == 4 && strcmp(words[1], "hold") == 0) return hold(words[2], (uint32_t)atoi(words[3]));
    if (count == 3 && strcmp(words[1], "follow") == 0) return follow(words[2]);
    return 2;
}
