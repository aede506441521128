/* The floor: what a plain hand-written loop costs. Complex model, five links, classical Runge-Kutta at a
   fixed step, valves read off the wave at every stage; friction smoothed, per axis. Reads frequency,
   pressure, lag, offset, duration and step from the command line; prints the processor time of the loop and the
   motion over the last cycle. Written from shared mechanics, not from the package's code. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { LINKS = 5, SEGMENTS = 4, STATES = 6 + 2 * SEGMENTS };

static const double LENGTH = 0.037, GAP = 0.012, MASS = 0.030, INERTIA = 1e-6;
static const double MU_T = 0.043, MU_N = 0.57, V_S = 0.002, GRAVITY = 9.81;
static const double C0 = 0.35, TAU1 = 0.08, TAU2 = 0.05;

typedef struct {
    double omega, pressure, lag, offset;
} Gait;

/* State: x, y, mean heading, their rates in the room (angular momentum for the last), kappa, kappa'. */
static void rates(const Gait *g, double time, const double *s, double *d)
{
    const double *kappa = s + 6, *dkappa = s + 6 + SEGMENTS;
    double angle[LINKS], turn[LINKS], x[LINKS], y[LINKS], vx[LINKS], vy[LINKS];
    double mean = 0, mean_turn = 0, mx = 0, my = 0, mvx = 0, mvy = 0;
    angle[0] = turn[0] = 0;
    for (int i = 0; i < SEGMENTS; i++) {
        angle[i + 1] = angle[i] + LENGTH * kappa[i];
        turn[i + 1] = turn[i] + LENGTH * dkappa[i];
    }
    for (int i = 0; i < LINKS; i++) {
        mean += angle[i] / LINKS;
        mean_turn += turn[i] / LINKS;
    }
    for (int i = 0; i < LINKS; i++) {
        angle[i] += s[2] - mean; /* in the room */
        turn[i] -= mean_turn;    /* relative to the mean heading */
    }
    double c[LINKS], n[LINKS];
    for (int i = 0; i < LINKS; i++) {
        c[i] = cos(angle[i]);
        n[i] = sin(angle[i]);
    }
    x[0] = y[0] = vx[0] = vy[0] = 0;
    for (int i = 0; i < SEGMENTS; i++) {
        double h = LENGTH * kappa[i] / 2, dh = LENGTH * dkappa[i] / 2;
        double small = fabs(h) < 1e-3;
        double sinc = small ? 1 - h * h / 6 : sin(h) / h;
        double dsinc = small ? -h / 3 : (cos(h) - sinc) / h;
        double middle = (angle[i] + angle[i + 1]) / 2, dmiddle = (turn[i] + turn[i + 1]) / 2;
        double cm = cos(middle), sm = sin(middle);
        double chord = LENGTH * sinc, dchord = LENGTH * dsinc * dh;
        x[i + 1] = x[i] + GAP / 2 * (c[i] + c[i + 1]) + chord * cm;
        y[i + 1] = y[i] + GAP / 2 * (n[i] + n[i + 1]) + chord * sm;
        vx[i + 1] = vx[i] - GAP / 2 * (n[i] * turn[i] + n[i + 1] * turn[i + 1]) + dchord * cm - chord * sm * dmiddle;
        vy[i + 1] = vy[i] + GAP / 2 * (c[i] * turn[i] + c[i + 1] * turn[i + 1]) + dchord * sm + chord * cm * dmiddle;
    }
    for (int i = 0; i < LINKS; i++) {
        mx += x[i] / LINKS;
        my += y[i] / LINKS;
        mvx += vx[i] / LINKS;
        mvy += vy[i] / LINKS;
    }
    double inertia = LINKS * INERTIA, shape = 0;
    for (int i = 0; i < LINKS; i++) {
        x[i] -= mx;
        y[i] -= my;
        vx[i] -= mvx;
        vy[i] -= mvy;
        inertia += MASS * (x[i] * x[i] + y[i] * y[i]);
        shape += MASS * (x[i] * vy[i] - y[i] * vx[i]) + INERTIA * turn[i];
    }
    double rate = (s[5] - shape) / inertia, fx = 0, fy = 0, moment = 0;
    for (int i = 0; i < LINKS; i++) {
        double ux = s[3] - rate * y[i] + vx[i], uy = s[4] + rate * x[i] + vy[i];
        double ft = -MU_T * MASS * GRAVITY * tanh((c[i] * ux + n[i] * uy) / V_S);
        double fn = -MU_N * MASS * GRAVITY * tanh((c[i] * uy - n[i] * ux) / V_S);
        double px = c[i] * ft - n[i] * fn, py = n[i] * ft + c[i] * fn;
        fx += px;
        fy += py;
        moment += x[i] * py - y[i] * px;
    }
    d[0] = s[3];
    d[1] = s[4];
    d[2] = rate;
    d[3] = fx / (LINKS * MASS);
    d[4] = fy / (LINKS * MASS);
    d[5] = moment;
    for (int i = 0; i < SEGMENTS; i++) {
        double valve = sin(g->omega * time + g->lag * (i + 1)) + g->offset > 0 ? 1 : -1;
        d[6 + i] = dkappa[i];
        d[6 + SEGMENTS + i] =
            -(1 / TAU1 + 1 / TAU2) * dkappa[i] + (C0 * g->pressure * valve - kappa[i]) / (TAU1 * TAU2);
    }
}

int main(int argc, char **argv)
{
    if (argc != 7) {
        fprintf(stderr, "usage: c_loop FREQUENCY PRESSURE LAG OFFSET DURATION STEP\n");
        return 2;
    }
    double frequency = atof(argv[1]);
    Gait g = {2 * M_PI * frequency, atof(argv[2]), atof(argv[3]), atof(argv[4])};
    double duration = atof(argv[5]), step = atof(argv[6]);
    long steps = lround(duration / step), cycle = lround(1 / frequency / step);
    double s[STATES] = {0}, t[STATES], k1[STATES], k2[STATES], k3[STATES], k4[STATES], mark[3] = {0};
    struct timespec begin, end;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
    for (long j = 0; j < steps; j++) {
        double time = j * step;
        if (j == steps - cycle)
            for (int i = 0; i < 3; i++) mark[i] = s[i];
        rates(&g, time, s, k1);
        for (int i = 0; i < STATES; i++) t[i] = s[i] + step / 2 * k1[i];
        rates(&g, time + step / 2, t, k2);
        for (int i = 0; i < STATES; i++) t[i] = s[i] + step / 2 * k2[i];
        rates(&g, time + step / 2, t, k3);
        for (int i = 0; i < STATES; i++) t[i] = s[i] + step * k3[i];
        rates(&g, time + step, t, k4);
        for (int i = 0; i < STATES; i++) s[i] += step / 6 * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i]);
    }
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
    double wall = (end.tv_sec - begin.tv_sec) + 1e-9 * (end.tv_nsec - begin.tv_nsec);
    printf("%.9g %.12g %.12g %.12g\n", wall, hypot(s[0] - mark[0], s[1] - mark[1]), s[2] - mark[2], 1 / frequency);
    return 0;
}
