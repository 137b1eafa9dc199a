# cython: boundscheck=False, wraparound=False
"""C tables passed in capsules, checked once before the cycle uses them."""

from cpython.pycapsule cimport PyCapsule_GetPointer
from libc.stdint cimport uint32_t, uintptr_t

from catenary.core._native cimport (
    CAT_IMAGE_CAPSULE,
    CAT_IMAGE_VERSION,
    CAT_LINK_CAPSULE,
    CAT_LINK_VERSION,
    CAT_SINK_CAPSULE,
    CAT_SINK_VERSION,
    cat_image,
    cat_link,
    cat_sink,
)


cdef const cat_link *link_in(object capsule) except NULL:
    """Return the link table of a capsule; check its version."""
    cdef const cat_link *link = <const cat_link *>PyCapsule_GetPointer(capsule, CAT_LINK_CAPSULE)
    if link.version != CAT_LINK_VERSION:
        raise ValueError(f"link: table version {link.version}, expected {CAT_LINK_VERSION}")
    return link


cdef cat_image *image_in(object capsule, plan) except NULL:
    """Return the image table of a capsule; check that it was made for this plan."""
    cdef cat_image *image = <cat_image *>PyCapsule_GetPointer(capsule, CAT_IMAGE_CAPSULE)
    if image.version != CAT_IMAGE_VERSION:
        raise ValueError(f"image: table version {image.version}, expected {CAT_IMAGE_VERSION}")
    mine = (image.output_size, image.input_size, image.unit_count)
    wanted = (plan.output_size, plan.input_size, len(plan.sync_units))
    if mine != wanted:
        raise ValueError(f"image: (output bytes, input bytes, sync units) {mine}, the plan has {wanted}")
    if plan.clock is not None:
        raise ValueError("clock: the owner of the image table controls the clocks; remove the plan's clock")
    return image


cdef const cat_sink *sink_in(object capsule, tuple sizes, uint32_t axes) except NULL:
    """Return the sink table of a capsule; check its block sizes [bytes] and its motion words."""
    cdef const cat_sink *sink = <const cat_sink *>PyCapsule_GetPointer(capsule, CAT_SINK_CAPSULE)
    if sink.version != CAT_SINK_VERSION:
        raise ValueError(f"sink: table version {sink.version}, expected {CAT_SINK_VERSION}")
    asked = (sink.record_size, sink.actual_size, sink.target_size)
    if asked != sizes:
        raise ValueError(f"sink: blocks of {asked} bytes, the engine has {sizes}")
    if sink.motion != NULL and (sink.motion_axes != axes or <uintptr_t>sink.motion % 64):
        raise ValueError(
            f"sink: motion words of {sink.motion_axes} axes, the engine has {axes}; they must begin at"
            " a multiple of 64 bytes"
        )
    return sink
