# Types of `response.py` where it is compiled; without a compiler the same file runs as plain Python.
cimport cython
cimport libc.math as math

cdef double SATURATED, NEARLY_FULL, BELOW
cdef Py_ssize_t MOST_STEPS


@cython.locals(load=double, least=double, span=double, further=double, group=Py_ssize_t, _=Py_ssize_t)
cpdef double span_us(
    double ahead_us, double from_us, double bit_us, double[::1] sent_us, double[::1] period_us, double[::1] jitter_us
) except? -1


@cython.locals(load=double, most=double, group=Py_ssize_t)
cpdef double bound_us(
    double ahead_us, double bit_us, double[::1] sent_us, double[::1] period_us, double[::1] jitter_us
) except? -1


@cython.locals(
    own_period_us=double, own_jitter_us=double, all_us=double, busy_us=double, worst=Py_ssize_t, worst_wait_us=double,
    worst_us=double, wait=double, instance=Py_ssize_t, first_us=double, due_us=double,
)
cpdef (double, double, double) worst_instance(
    Py_ssize_t group, double own_us, double ahead_us, double bit_us, double[::1] sent_us, double[::1] period_us,
    double[::1] jitter_us
)


@cython.locals(
    group=Py_ssize_t[::1], place=double[::1], last=double[:, ::1], frame_us=double[:, ::1],
    blocks_us=double[:, ::1], sent_us=double[:, ::1], enough_us=double[:, ::1], period_us=double[:, ::1],
    bit_us=double[::1], once_us=double[:, ::1], jitter_us=double[:, ::1], blocking_us=double[:, ::1],
    instance=double[:, ::1], wait_us=double[:, ::1], response_us=double[:, ::1], longest_us=double[::1],
    before_us=double[::1], count=Py_ssize_t, groups=Py_ssize_t, point=Py_ssize_t, ends=double[::1], frames=double[::1],
    blocks=double[::1], sent=double[::1], once=double[::1], periods=double[::1], jitters=double[::1], rank=Py_ssize_t,
    load=double, first_us=double, number=Py_ssize_t, sender=Py_ssize_t, index=Py_ssize_t, ahead_us=double, worst=double,
    wait=double, response=double,
)
cdef object _respond(Py_ssize_t[::1] answered, object senders, object start, object found)


@cython.locals(
    before_us=double[:, ::1], lower_us=double[:, ::1], identifiers=double[:, ::1], burst=double[:, ::1],
    period_us=double[:, ::1], jitter_us=double[:, ::1], deadline_us=double[:, ::1], lasts_us=double[::1],
    blocked_us=double[::1], point=Py_ssize_t, message=Py_ssize_t, before=double[::1], lower=double[::1],
    periods=double[::1], jitters=double[::1], numbers=double[::1], bursts=double[::1], deadlines=double[::1],
    ahead_us=double, bit=double, span=double, load=double, blocked=double, longer=double,
)
cpdef object cycle_waits(Py_ssize_t most, double[::1] others_us, double[::1] bit_us, object messages)


@cython.locals(
    first=double, second=double, third=double, us=double, queued=double, message=Py_ssize_t, _=Py_ssize_t,
)
cpdef double blocking_us(
    double span, Py_ssize_t most, double[::1] lower_us, double[::1] identifiers, double[::1] burst,
    double[::1] period_us, double[::1] deadline_us
) except? -1
