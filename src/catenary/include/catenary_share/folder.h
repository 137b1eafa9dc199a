/* Folders of shares (share/folder.py): /run/catenary, or one folder for each user in /dev/shm. */
#ifndef CATENARY_SHARE_FOLDER_H
#define CATENARY_SHARE_FOLDER_H

#include <ctype.h>
#include <errno.h>
#include <sys/stat.h>

#include "process.h"

#define CAT_GROUP_FOLDER "/run/catenary"
#define CAT_USER_FOLDERS "/dev/shm/catenary-"

enum { CAT_NAME_MAX = 64, CAT_FOLDER_SIZE = 64, CAT_UID_LINES = 4096 };

/* Search of a share: the accepted users, and the first file of another user. */
typedef struct cat_search {
    uid_t owners[2];
    int owner_count;
    uid_t foreign_owner;
    int is_foreign, is_denied;
} cat_search;

static int cat_is_name(const char *name) {
    size_t k, length = strlen(name);
    if (length < 1 || length > CAT_NAME_MAX || !isalnum((unsigned char)name[0])) return 0;
    for (k = 0; k < length; k++) {
        unsigned char c = (unsigned char)name[k];
        if (c >= 0x80 || !(isalnum(c) || strchr("._-", c))) return 0;
    }
    return 1;
}

/* Return the id of a user in the parent of this user namespace, user_namespaces(7). */
static long long cat_outside(uid_t uid) {
    char text[CAT_UID_LINES], *line, *rest = NULL;
    long long inside, outside, count;
    cat_read_file("/proc/self/uid_map", text, sizeof text);
    for (line = strtok_r(text, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) {
        if (sscanf(line, "%lld %lld %lld", &inside, &outside, &count) != 3) continue;
        if (inside <= (long long)uid && (long long)uid < inside + count) return outside + (long long)uid - inside;
    }
    return (long long)uid;
}

/* Return 1 if /run/catenary belongs to root, and only root or a group with the sticky bit can write. */
static int cat_is_group_folder(void) {
    struct stat status;
    if (lstat(CAT_GROUP_FOLDER, &status) != 0 || !S_ISDIR(status.st_mode) || status.st_uid != 0) return 0;
    return !(status.st_mode & S_IWOTH) && (status.st_mode & S_ISVTX || !(status.st_mode & S_IWGRP));
}

static cat_search cat_search_of(int64_t uid) {
    cat_search search;
    memset(&search, 0, sizeof search);
    search.owners[0] = uid < 0 ? geteuid() : (uid_t)uid;
    search.owners[1] = 0;
    search.owner_count = uid < 0 ? 2 : 1;
    return search;
}

static int cat_is_trusted(const cat_search *search, uid_t owner) {
    return owner == search->owners[0] || owner == search->owners[search->owner_count - 1];
}

/* Return 1 if the folder has a share of this name that a trusted user owns. */
static int cat_is_there(cat_search *search, const char *folder, const char *name) {
    char path[CAT_FOLDER_SIZE + CAT_NAME_MAX + 16];
    struct stat status;
    snprintf(path, sizeof path, "%s/share-%s", folder, name);
    if (lstat(path, &status) != 0) {
        search->is_denied |= errno == EACCES && search->owner_count == 1;
        return 0;
    }
    if (cat_is_trusted(search, status.st_uid)) return 1;
    if (!search->is_foreign) search->foreign_owner = status.st_uid;
    search->is_foreign = 1;
    return 0;
}

/* Write the folder of the share `name` to `folder` of CAT_FOLDER_SIZE bytes. */
static int cat_find_folder(cat_search *search, const char *name, char *folder, catenary_error *error) {
    int k;
    snprintf(folder, CAT_FOLDER_SIZE, "%s", CAT_GROUP_FOLDER);
    if (cat_is_group_folder() && cat_is_there(search, folder, name)) return 0;
    search->is_denied = 0;
    for (k = 0; k < search->owner_count; k++) {
        snprintf(folder, CAT_FOLDER_SIZE, "%s%lld", CAT_USER_FOLDERS, cat_outside(search->owners[k]));
        if (cat_is_there(search, folder, name)) return 0;
    }
    if (search->is_foreign) {
        return cat_fail(error, CATENARY_E_NOT_TRUSTED, "the share '%s' belongs to another user (%u); pass this user id "
                        "if you trust that user", name, (unsigned)search->foreign_owner);
    }
    if (search->is_denied) {
        return cat_fail(error, CATENARY_E_PERMISSION, "no permission to search %s; the writer of the share can "
                        "allow it: cat.Share(..., mode=0o640) for the group", folder);
    }
    return cat_fail(error, CATENARY_E_NOT_FOUND, "there is no share '%s'; a share exists while a Loop with "
                    "sink=cat.Share(...) is open", name);
}

#endif
