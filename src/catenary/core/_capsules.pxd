from libc.stdint cimport uint32_t

from catenary.core._native cimport cat_image, cat_link, cat_sink

cdef const cat_link *link_in(object capsule) except NULL
cdef cat_image *image_in(object capsule, plan) except NULL
cdef const cat_sink *sink_in(object capsule, tuple sizes, uint32_t axes) except NULL
