/* The servo kernel's arithmetic for a loop on the node, in C: the yardstick of test_bench_servo.py.

   The same operations in the same order as busplan/servo/kernel.py, so the positions agree to the last bits; what it
   leaves out is what Python needs around it: rows, chunks, losses, jitter and the loop on the host. */

#include <math.h>
#include <stddef.h>

#define ROUND 6755399441055744.0

struct axis {
    double kp, ki, kd, period, counts, resolution, lowest, highest, levels, level, offset, friction, sharpness;
    double feed_share, drive_keep, drive_shift, friction_keep, friction_shift;
};

void run_axis(const struct axis *a, const double *setpoints, size_t cycles, size_t steps, double cycle_s,
              double *out) {
    double position = setpoints[0], velocity = 0, disturbance = 0, sign = 0, integral = 0, last = 0;
    for (size_t k = 0; k < cycles; k++) {
        double start = setpoints[k ? k - 1 : 0], end = setpoints[k];
        double aim = start, move = (end - start) / (double)steps;
        double feed = a->feed_share * ((end - start) / cycle_s);
        for (size_t i = 0; i < steps; i++) {
            double error = aim - position;
            if (a->counts > 0)
                error = aim - (position * a->counts + ROUND - ROUND) * a->resolution;
            double command = a->kp * error + feed;
            if (a->ki > 0) {
                integral += error * a->period;
                command += a->ki * integral;
            }
            if (a->kd > 0) {
                command += a->kd * (error - last);
                last = error;
            }
            if (command > a->highest) {
                command = a->highest;
                if (a->ki > 0 && error > 0) integral -= error * a->period;
            } else if (command < a->lowest) {
                command = a->lowest;
                if (a->ki > 0 && error < 0) integral -= error * a->period;
            }
            if (a->levels > 0)
                command = (command * a->levels + ROUND - ROUND) * a->level;
            aim += move;
            if (a->friction > 0) {
                double turned = velocity * a->sharpness;
                turned = turned > 20 ? 1 : turned < -20 ? -1 : tanh(turned);
                disturbance += a->friction * (sign - turned);
                sign = turned;
            }
            double wanted = command + a->offset, lag = velocity - wanted;
            position += wanted * a->period + lag * a->drive_shift + disturbance * a->friction_shift;
            velocity = wanted + lag * a->drive_keep;
            disturbance *= a->friction_keep;
            *out++ = position;
        }
    }
}
