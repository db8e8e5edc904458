# Types of `kernel.py` where it is compiled; without a compiler the same file runs as plain Python.
cimport cython
cimport libc.math as math
from libc.stdint cimport int64_t

cdef int64_t CONTROL, SWITCH, STORE
cdef double ROUND
cdef Py_ssize_t POSITION, VELOCITY, DISTURBANCE, SIGN, COMMAND, INTEGRAL, LAST_ERROR, QUEUE


@cython.locals(
    kp=double, ki=double, kd=double, period=double, counts=double, resolution=double, lowest=double, highest=double,
    levels=double, level=double, offset=double, friction=double, sharpness=double, position=double, velocity=double,
    disturbance=double, sign=double, command=double, pending=double, remembers=bint, stored=Py_ssize_t, row=Py_ssize_t,
    act=int64_t, control=int64_t, switch=int64_t, store=int64_t, aim=double, move=double, feed=double, dt=double,
    keep=double, shift=double, fade=double, fade_shift=double, error=double, turned=double, wanted=double, lag=double,
    newest=double, last=Py_ssize_t, place=Py_ssize_t, _=int64_t,
)
cpdef Py_ssize_t run_rows(
    double[::1] state,
    tuple constants,
    double[::1] out,
    const int64_t[:] substeps,
    const double[:] target,
    const double[:] increment,
    const double[:] forward,
    const int64_t[:] action,
    const double[:] length,
    const double[:] drive_keep,
    const double[:] drive_shift,
    const double[:] friction_keep,
    const double[:] friction_shift,
) except -1


@cython.locals(table=double, motor=double, i=Py_ssize_t)
cpdef object drag(double[::1] position, double half)
