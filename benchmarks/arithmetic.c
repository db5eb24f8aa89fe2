/* Heave, magnetic spring, commercial drive and PI law at a fixed step: the arithmetic of
 * sim_plant.body, magnetic_spring, pto, drive, cots_drive, analyser and controllers.impedance,
 * operation by operation, so that the energies of both are the same to the last bit.
 * Compile without contraction of products and sums (-ffp-contract=off). Forces in N, up positive. */

#include <math.h>

enum { MOST_STATIONS = 32 };

struct body { double inertia, hydrostatic, viscous, quadratic, a0, a1, a2, a3, a4, b1, b2, b3, b4; };
struct motion { double x, v, z1, z2, z3, z4, z5; };
struct pto { double force_per_current, copper, viscous, coulomb, guide, coulomb_velocity; };
struct loop { double limit, time_constant, enable_delay, watchdog; };
struct cots { double fixed, linear, square, voltage, resistance; };
struct spring { double angle_per_metre, reach, sine, effect, speed; };
struct law { double kp, ki, ramp, newtons_per_ampere; };

struct drive { double current, mean; int enabled, fault; double waited, age; int saturated; };
struct stator { double position, rate, slope; int arrived; };
struct analyser { double sum_ac, sum_dc; int samples; double ac, dc, age; };
struct ramp { double value, target, rate; };

static double table_rate(const struct spring *p, int n, const double *at, const double *rate,
                         double stator) {
    if (!(stator > at[0])) return p->effect * rate[0];
    for (int i = 0; i < n - 1; i++)
        if (stator < at[i + 1]) {
            double share = (stator - at[i]) / (at[i + 1] - at[i]);
            double rise = rate[i + 1] - rate[i];
            return p->effect * (rate[i] + share * rise);
        }
    return p->effect * rate[n - 1];
}

static double table_slope(const struct spring *p, int n, const double *at, const double *rate,
                          double stator) {
    double total = 0.0, sides = 0.0;
    for (int i = 0; i < n - 1; i++) {
        double low = at[i], high = at[i + 1];
        int inside = low <= stator && stator <= high;
        if (inside || (i == 0 && stator < low) || (i == n - 2 && stator > high)) {
            total = total + (rate[i + 1] - rate[i]) / (high - low);
            sides = sides + 1.0;
        }
    }
    return sides > 0.0 ? p->effect * total / sides : 0.0;
}

static double spring_force(const struct spring *p, double rate, double x) {
    if (p->sine == 0.0) return -rate * x;
    double twice = 2.0 * p->angle_per_metre * x;
    if (!(fabs(twice) < 1.0e6)) return 0.0;
    return -rate * p->reach * sin(twice);
}

static double passive(const struct spring *s, const struct pto *p, double rate, double x, double v) {
    double dry = p->coulomb + p->guide * fabs(0.0);
    return spring_force(s, rate, x) + -(p->viscous * v + dry * tanh(v / p->coulomb_velocity));
}

static struct stator stator_step(const struct spring *p, int n, const double *at,
                                 const double *rate, struct stator s, double target, double dt) {
    double position = s.position;
    if (position == target) {
        s.arrived = 1;
        return s;
    }
    double reach = p->speed * dt;
    double goal = target > at[0] ? target : at[0];
    goal = goal < at[n - 1] ? goal : at[n - 1];
    double gap = goal - position;
    if (fabs(gap) <= reach) position = goal;
    else if (gap > 0.0) position = position + reach;
    else position = position - reach;
    struct stator moved = {position, table_rate(p, n, at, rate, position),
                           table_slope(p, n, at, rate, position), 0};
    return moved;
}

static struct drive drive_step(const struct loop *p, struct drive s, double command, double dt) {
    double limit = p->limit, age = 0.0, waited = 0.0;
    int fault = s.fault, enabled = 0, saturated = 0;
    if (fault == 0) {
        if (age > p->watchdog || !(fabs(command) < 1.0e6)) fault = 1;
        else {
            waited = s.waited + dt;
            if (s.enabled == 1 || waited > p->enable_delay) enabled = 1;
        }
    }
    double goal = 0.0;
    if (enabled == 1) {
        limit = limit < 1.0e9 ? limit : 1.0e9;
        goal = command;
        if (goal > limit) { goal = limit; saturated = 1; }
        else if (goal < -limit) { goal = -limit; saturated = 1; }
    }
    double gap = s.current - goal;
    double decay = exp(-dt / p->time_constant);
    double mean = goal + gap * (1.0 - decay) * p->time_constant / dt;
    struct drive after = {goal + gap * decay, mean, enabled, fault, waited, age + dt, saturated};
    return after;
}

static struct analyser analyse(double window, struct analyser s, double ac, double dc, double dt) {
    s.sum_ac = s.sum_ac + ac;
    s.sum_dc = s.sum_dc + dc;
    s.samples = s.samples + 1;
    if ((s.samples + 0.5) * dt > window) {
        struct analyser full = {0.0, 0.0, 0, s.sum_ac / s.samples, s.sum_dc / s.samples, 0.0};
        return full;
    }
    s.age = s.age + dt;
    return s;
}

static struct ramp ramp_step(struct ramp r, double target, double duration, double dt) {
    if (r.value == target && r.target == target) return r;
    double rate = r.rate;
    if (target != r.target) {
        double distance = target - r.value;
        if (distance < 0.0) distance = -distance;
        rate = duration > 0.0 ? distance / duration : distance / dt;
    }
    double step = rate * dt, gap = target - r.value;
    struct ramp there = {target, target, rate};
    if (-step <= gap && gap <= step) return there;
    struct ramp way = {gap > 0.0 ? r.value + step : r.value - step, target, rate};
    return way;
}

/* Simulate `ticks` steps; energies (J) into energy[0..2]: mechanical on the body, AC, DC. */
void simulate(const double *constants, const double *stations, const double *rates, int n,
          const double *excitation, int period, double start, double target, double window,
          double dt, long ticks, double *energy) {
    struct body b;
    struct pto p;
    struct loop l;
    struct cots c;
    struct spring s;
    struct law w;
    double *to[] = {(double *)&b, (double *)&p, (double *)&l, (double *)&c, (double *)&s,
                    (double *)&w};
    const int size[] = {13, 6, 4, 5, 5, 4};
    for (int i = 0, k = 0; i < 6; i++)
        for (int j = 0; j < size[i]; j++) to[i][j] = constants[k++];

    struct motion m = {0};
    struct drive d = {0};
    struct analyser a = {0.0, 0.0, 0, 0.0, c.fixed, 0.0};
    struct stator st = {start, table_rate(&s, n, stations, rates, start),
                        table_slope(&s, n, stations, rates, start), 1};
    struct ramp kp = {0}, ki = {0};
    double held = spring_force(&s, st.rate, m.x);
    double mechanical = 0.0, ac = 0.0, dc = 0.0, half = 0.5 * dt;

    for (long tick = 0; tick < ticks; tick++) {
        double now = excitation[tick % period], after = excitation[(tick + 1) % period];
        kp = ramp_step(kp, w.kp, w.ramp, dt);
        ki = ramp_step(ki, w.ki, w.ramp, dt);
        double wanted = kp.value * m.v + ki.value * m.x + 0.0 * 0.0 + 0.0;
        d = drive_step(&l, d, wanted / w.newtons_per_ampere, dt);
        double motor = p.force_per_current * d.mean;

        double applied = now + motor + held;
        double memory = b.b1 * m.z2 + b.b2 * m.z3 + b.b3 * m.z4 + b.b4 * m.z5;
        double force = applied - b.hydrostatic * m.x - memory
                       - (b.viscous + b.quadratic * fabs(m.v)) * m.v;
        double x = m.x + half * m.v, v = m.v + half * (force / b.inertia);

        held = passive(&s, &p, st.rate, x, v);
        applied = 0.5 * (now + after) + motor + held;
        double z1 = m.z1 + half * m.z2, z2 = m.z2 + half * m.z3, z3 = m.z3 + half * m.z4;
        double z4 = m.z4 + half * m.z5;
        double z5 = m.z5 + half * (m.v - b.a0 * m.z1 - b.a1 * m.z2 - b.a2 * m.z3 - b.a3 * m.z4
                                   - b.a4 * m.z5);
        memory = b.b1 * z2 + b.b2 * z3 + b.b3 * z4 + b.b4 * z5;
        force = applied - b.hydrostatic * x - memory - (b.viscous + b.quadratic * fabs(v)) * v;
        struct motion end = {
            m.x + dt * v, m.v + dt * (force / b.inertia), m.z1 + dt * z2, m.z2 + dt * z3,
            m.z3 + dt * z4, m.z4 + dt * z5,
            m.z5 + dt * (v - b.a0 * z1 - b.a1 * z2 - b.a2 * z3 - b.a3 * z4 - b.a4 * z5)};
        m = end;

        st = stator_step(&s, n, stations, rates, st, target, dt);
        double between = held;
        held = passive(&s, &p, st.rate, m.x, m.v);
        double power_ac = motor * v + p.copper * motor * motor;
        double amps = fabs(d.mean);
        double power_dc = power_ac + (c.fixed + (c.linear + c.square * amps) * amps);
        a = analyse(window, a, power_ac, power_dc, dt);
        mechanical = mechanical + (motor + between) * v * dt;
        ac = ac + power_ac * dt;
        dc = dc + power_dc * dt;
    }
    energy[0] = mechanical;
    energy[1] = ac;
    energy[2] = dc;
    energy[3] = a.ac;
}
