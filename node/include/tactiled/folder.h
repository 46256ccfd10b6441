/* Finds and checks the run-time folder of a daemon, which has its segment and its control socket. Daemon and
 * readers use the same rule.
 *
 * A caller or the environment variable TACTILED_RUNTIME_DIR can name the folder. Without a name, a reader looks
 * in /run/tactiled, the folder of the installed service, and then in $XDG_RUNTIME_DIR/tactiled, the folder of a
 * user's own daemon. The first folder that has a segment of the wanted name is used.
 *
 * A folder is trusted if only its owner and root can add, rename or remove its files. The same must hold for each
 * folder above it, because a user who can write there could replace the folder. A sticky folder of root, such as
 * /tmp, fails itself, because any user can create a file there while the daemon does not run. A folder in it is
 * trusted if it belongs to root or to the caller: no other user can create or replace that. /dev/shm is used only
 * where it is named explicitly. Programs that were built with headers without this file look in
 * /dev/shm only. */
#ifndef TACTILED_FOLDER_H
#define TACTILED_FOLDER_H

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/auxv.h>
#include <sys/stat.h>
#include <unistd.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TACTILED_SERVICE_FOLDER "/run/tactiled"
#define TACTILED_SHARED_FOLDER "/dev/shm"
#define TACTILED_FOLDER_VARIABLE "TACTILED_RUNTIME_DIR"
#define TACTILED_FOLDER_SIZE 160 /* including the terminating zero */
#define TACTILED_SHARED_WARNING                                      \
    "any local user can create a segment in " TACTILED_SHARED_FOLDER \
    " while its daemon does not "                                    \
    "run: nothing proves that these values are measured"

#if defined(O_PATH)
#define TACTILED_O_PATH O_PATH
#elif defined(__O_PATH) /* the C library declares O_PATH only with _GNU_SOURCE */
#define TACTILED_O_PATH __O_PATH
#else
#define TACTILED_O_PATH O_RDONLY
#endif

/* Returns the folder that the environment variable names, or NULL. A program with rights that its caller lacks
 * ignores the variables. */
static inline const char* tactiled_variable(const char* name) {
    const char* value = getauxval(AT_SECURE) != 0 ? NULL : getenv(name);
    return value != NULL && value[0] != 0 ? value : NULL;
}

/* Writes the n-th folder in which a reader looks if its caller gives no folder. Returns 0 after the last one. */
static inline int tactiled_folder(unsigned n, char* folder, size_t size) {
    const char* given = tactiled_variable(TACTILED_FOLDER_VARIABLE);
    const char* users = tactiled_variable("XDG_RUNTIME_DIR");
    int length;
    if (given != NULL)
        length = n == 0 ? snprintf(folder, size, "%s", given) : 0;
    else if (n == 0)
        length = snprintf(folder, size, "%s", TACTILED_SERVICE_FOLDER);
    else
        length = n == 1 && users != NULL ? snprintf(folder, size, "%s/tactiled", users) : 0;
    if (length >= (int)size) folder[0] = 0; /* too long: tactiled_open_folder() refuses an empty path */
    return length > 0;
}

/* Opens a folder that only its owner and root can write to, and for which the same holds for each folder above
 * it. Returns a descriptor for openat() and the owner, or -1 with the reason in `why`; errno is ENOENT if the
 * folder does not exist, else another number. `folder` is an absolute path. A symbolic link in the path is
 * refused, because the folder of the link would have to be trusted, too. Each folder is opened relative to the
 * one before it and is examined after it was opened, so that it cannot be exchanged in between. */
static inline int tactiled_open_folder(const char* folder, uid_t* owner, char* why, size_t why_size) {
    const char* at = folder;
    uid_t above = 0;   /* the user, other than root, who owns a folder above */
    int in_shared = 0; /* any user can create a folder beside this one */
    int fd = folder[0] == '/' ? open("/", TACTILED_O_PATH | O_DIRECTORY | O_CLOEXEC) : -1;
    const char* wrong = folder[0] == '/' ? NULL : "is not a full path";
    char name[NAME_MAX + 1];
    struct stat status;
    if (strlen(folder) >= TACTILED_FOLDER_SIZE) wrong = "the path is too long";
    while (wrong == NULL) {
        const char* const end = at;
        size_t length;
        int next, error, is_shared;
        at += strspn(at, "/");
        length = strcspn(at, "/");
        if (fd < 0 || fstat(fd, &status) != 0) {
            error = errno;
            snprintf(why, why_size, "%.*s: %s", (int)(end - folder), folder,
                     error == ENOTDIR || error == ELOOP ? "not a folder; symbolic links are not followed" : strerror(error));
            if (fd >= 0) close(fd);
            errno = error;
            return -1;
        }
        is_shared = (status.st_mode & (S_IWGRP | S_IWOTH)) != 0;
        if (is_shared && (length == 0 || status.st_uid != 0 || (status.st_mode & S_ISVTX) == 0))
            wrong = "other users than its owner can write to it";
        else if (in_shared && status.st_uid != 0 && status.st_uid != geteuid())
            wrong = "another user than root or you made it, where any user can make one";
        else if (length != 0 && status.st_uid != 0 && above != 0 && status.st_uid != above)
            wrong = "it is inside the folder of another user";
        else if (length == 0 && above != 0 && status.st_uid != above)
            wrong = "it is inside the folder of another user than its owner";
        else if (length > NAME_MAX || (length == 1 && at[0] == '.') || (length == 2 && at[0] == '.' && at[1] == '.'))
            wrong = "a name in the path is too long, \".\" or \"..\"";
        if (wrong != NULL) {
            snprintf(why, why_size, "%.*s: not a trusted folder: %s", end == folder ? 1 : (int)(end - folder), folder,
                     wrong);
            close(fd);
            errno = EPERM;
            return -1;
        }
        if (length == 0) {
            *owner = status.st_uid;
            return fd;
        }
        if (status.st_uid != 0) above = status.st_uid;
        in_shared = is_shared;
        memcpy(name, at, length);
        name[length] = 0;
        next = openat(fd, name, TACTILED_O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
        error = errno;
        close(fd);
        errno = error;
        fd = next;
        at += length;
    }
    snprintf(why, why_size, "folder \"%.100s\": %s", folder, wrong);
    if (fd >= 0) close(fd);
    errno = EINVAL;
    return -1;
}

/* Opens the file of a segment for reading, in a trusted folder or in /dev/shm. The file must belong to the owner
 * of the folder or to root, and only its owner may have the right to write to it. Returns the descriptor and the
 * file's status, or -1 with the reason in `why`; errno is ENOENT if the folder or the file does not exist, else
 * another number. */
static inline int tactiled_open_file(const char* folder, const char* name, struct stat* status, char* why, size_t why_size) {
    const int shared = strcmp(folder, TACTILED_SHARED_FOLDER) == 0;
    const char* wrong = NULL;
    uid_t owner = 0;
    int error, fd = -1;
    const int place = shared ? open(folder, TACTILED_O_PATH | O_DIRECTORY | O_CLOEXEC)
                             : tactiled_open_folder(folder, &owner, why, why_size);
    if (place < 0) {
        if (shared) snprintf(why, why_size, "%s: %s", folder, strerror(errno));
        return -1;
    }
    /* O_NONBLOCK: opening a FIFO must not block the reader */
    fd = openat(place, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    error = errno;
    close(place);
    if (fd < 0) {
        snprintf(why, why_size, "%s/%s: %s%s", folder, name, strerror(error),
                 error == ENOENT   ? " (no daemon of that name runs)"
                 : error == EACCES ? " (join the group of the segment: ls -l shows it)"
                                   : "");
        errno = error;
        return -1;
    }
    if (fstat(fd, status) != 0 || !S_ISREG(status->st_mode))
        wrong = "not a segment";
    else if (!shared && status->st_uid != owner && status->st_uid != 0)
        wrong = "belongs neither to the owner of its folder nor to root: not a daemon's";
    else if ((status->st_mode & (S_IWGRP | S_IWOTH)) != 0)
        wrong = "others than its owner may write it: not a daemon's";
    if (wrong == NULL) return fd;
    snprintf(why, why_size, "%s/%s: %s", folder, name, wrong);
    close(fd);
    errno = EPERM;
    return -1;
}

#ifdef __cplusplus
}
#endif
#endif
