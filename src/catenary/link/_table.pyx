"""The Python methods of a link, over its C table (`native/link.h`).

Compiled links derive from `TableLink`, fill its `table` and inherit the rest. `close` first replaces
the functions of the table, so that later calls return -EBADF (`now`: 0). A native thread may still
be inside an earlier call, or read a frame that it received. `close_table` must therefore keep the
memory and descriptors of these functions valid. `__dealloc__` releases them after the last use of
the table.
"""

from cpython.exc cimport PyErr_CheckSignals
from cpython.pycapsule cimport (
    PyCapsule_GetContext, PyCapsule_GetPointer, PyCapsule_New, PyCapsule_SetContext,
)
from cpython.ref cimport Py_DECREF, Py_INCREF, PyObject
from libc.errno cimport EBADF, EINTR
from libc.stdint cimport int64_t, uint8_t, uint32_t
from libc.string cimport memset

import os

from catenary.errors import LinkError
from catenary.link.protocol import open_link


cdef cat_link *table_of(object capsule) except NULL:
    """Return the checked table of a capsule. The caller must keep the capsule alive."""
    cdef cat_link *table = <cat_link *> PyCapsule_GetPointer(capsule, CAT_LINK_CAPSULE)
    if table.version != CAT_LINK_VERSION:
        raise ValueError(f"link table of version {table.version}, expected {CAT_LINK_VERSION}")
    return table


def capsule_in_virtual_time(object capsule):
    return table_of(capsule).flags & CAT_LINK_VIRTUAL_TIME != 0


cdef void release_owner(object capsule) noexcept:
    cdef void *owner = PyCapsule_GetContext(capsule)
    if owner != NULL:
        Py_DECREF(<object> owner)


cdef int closed_send(void *self, const uint8_t *frame, uint32_t length) noexcept nogil:
    return -EBADF


cdef int closed_receive(void *self, const uint8_t **frame) noexcept nogil:
    return -EBADF


cdef int64_t closed_now(void *self) noexcept nogil:
    return 0


cdef int closed_wait_until(void *self, int64_t deadline, int wake_on_frame) noexcept nogil:
    return -EBADF


cdef class TableLink:
    """Owner of a link table; base class of the compiled links."""

    def __cinit__(self):
        memset(&self.table, 0, sizeof(cat_link))
        self.table.version = CAT_LINK_VERSION
        self.name = ""
        self.disconnect()

    cdef int close_table(self) except -1:
        """Release the device or the file.

        It is called at most once, after the functions of the table were replaced. Another thread may
        still be inside one of the old functions.
        """
        return 0

    cdef void disconnect(self):
        cat_link_replace_calls(
            &self.table, closed_send, closed_receive, closed_now, closed_wait_until
        )

    @property
    def capsule(self):
        """Capsule with the link table, for compiled code.

        It keeps this object alive. `close` closes the link even if the capsule is still in use.
        """
        capsule = PyCapsule_New(&self.table, CAT_LINK_CAPSULE, release_owner)
        PyCapsule_SetContext(capsule, <void *> <PyObject *> self)
        Py_INCREF(self)
        return capsule

    @property
    def closed(self):
        return self.table.send == closed_send

    def open_link(self):
        """Return this link, which is already open."""
        return self

    def send(self, bytes frame not None):
        cdef int status = self.table.send(self.table.self, frame, <uint32_t> len(frame))
        if status < 0:
            raise self.failed("send", -status)

    def receive(self):
        cdef const uint8_t *frame = NULL
        cdef int length = self.table.receive(self.table.self, &frame)
        if length < 0:
            raise self.failed("receive", -length)
        return frame[:length] if length > 0 else None

    def now(self):
        return self.table.now(self.table.self)

    def wait_until(self, int64_t deadline_ns, bint wake_on_frame):
        cdef int status
        while True:
            with nogil:
                status = self.table.wait_until(self.table.self, deadline_ns, wake_on_frame)
            if status != -EINTR:
                break
            PyErr_CheckSignals()
        if status < 0:
            raise self.failed("wait", -status)
        return status == 1

    def explain(self, int number):
        """Return a LinkError that explains an errno; None if the link cannot explain it."""
        return None

    cdef failed(self, str verb, int number):
        explained = self.explain(number)
        if explained is not None:
            return explained
        hint = "the link is closed" if number == EBADF else ""
        return LinkError(f"{self.name}: cannot {verb}: {os.strerror(number)}", hint=hint)

    def close(self):
        if self.closed:
            return
        self.disconnect()
        self.close_table()

    def __enter__(self):
        return self

    def __exit__(self, *exc_info):
        self.close()

    def __repr__(self):
        return f"<{type(self).__name__} {self.name}{' (closed)' if self.closed else ''}>"


def explained_by(link, int number):
    """Return a link's error for an errno; None if the link cannot explain it."""
    explain = getattr(link, "explain", None)
    return None if explain is None else explain(number)


cdef class WrapperLink(TableLink):
    """Owner of another link, which it wraps and closes; base class of recorders and injectors."""

    cdef int wrap(self, object link) except -1:
        """Open `link` if it is a source; use its table, its name and the flags of its clock."""
        opened = open_link(link)
        self.inner_capsule = opened.capsule
        self.inner = table_of(self.inner_capsule)
        self.link = opened
        self.name = opened.name
        self.table.flags = self.inner.flags & ~(
            CAT_LINK_SPENDS | CAT_LINK_POLLS | CAT_LINK_FORETELLS
        )
        return 0

    def explain(self, int number):
        return explained_by(self.link, number)

    cdef int close_table(self) except -1:
        self.link.close()
        return 0
