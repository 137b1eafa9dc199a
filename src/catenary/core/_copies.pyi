"""Copies between devices, from the input image to the output image; private to the core."""
