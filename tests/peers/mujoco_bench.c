// Speed of MuJoCo's C library on the project's action; compiled and run by mujoco_bench.py.
//
// One action = restore (s, theta) + 20 control steps of 1/60 s + reading the observation, on one thread.
//
// Restore: masses, inertias, centres of mass, geom sizes and pair friction are written into mjModel in place, then what
// derives from them is recomputed and qpos/qvel are set. mj_setConst recomputes everything ("set_const_us": 1.7 to 3.4
// microseconds); the timing uses the cheaper valid way, closed forms of the constants that this model's contacts use
// (derive(), "restore_us": below 0.3 in all), which are compared with mj_setConst at start (exit status 4 on a
// difference). mj_resetData ("reset_data_us": 3.7) is not needed: what carries over from one step to the next is qpos,
// qvel, time and qacc_warmstart. Against 130 and more for the 20 steps none of this matters.
// Since MuJoCo 4, a centre of mass can only be moved in place in bodies compiled with simple="false".
//
// Each control step is 1, 2 or 10 calls of mj_step; the tool is three slide joints whose qpos and qvel are overwritten
// with the time course before each of them, and the contact force on it is read with mj_contactForce after each.
// All else is MuJoCo's default: Euler, Newton, 100 iterations at most, tolerance 1e-8, solref 0.02 1,
// solimp 0.9 0.95 0.001. refsafe raises a solref time constant below two steps, so at 1/60 s it is 0.033 s.
//
// What the options cost, with 1 substep: the elliptic cone 1.3 times the pyramidal one without a second free body and 1.5
// to 1.9 times with one (3 rows per contact instead of 4, but a dearer Newton step); the hand 1.0 to 1.2 times the ball;
// a movable obstacle 2 to 3 times none (a second body on 4 contacts), a fixed one 1.1 to 1.4 times. Two substeps cost
// 2.0 to 2.5 times one, ten 8 to 10 times. Newton is the default and the fastest solver here.
//
// With a fixed obstacle in line with the tool the object is squeezed between the two, and what MuJoCo gives way by is the
// softness of its default contacts: the pyramidal force is not a physical figure there.

#include <math.h>
#include <mujoco/mujoco.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define CONTROL_STEPS 20
#define TRAVEL 0.02
#define MAX_GEOMS 8

static double now_us(void) {
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static double share(double t) { return t * t * t * (10 - 15 * t + 6 * t * t); }
static double rate(double t) { return 30 * t * t * (1 - t) * (1 - t); }

// What changes from one hypothesis to the next: shapes and bodies that can move.
typedef struct {
  double mass, com[3], size[3], friction;
} Theta;

typedef struct {
  mjModel* m;
  mjData* d;
  int object, obstacle, object_geom, tool_geoms, movable;
  double qpos0[17], qvel0[16];
  Theta object_theta, obstacle_theta;
} World;

static void set_box(mjModel* m, int body, int geom, const Theta* t) {
  const double x = 2 * t->size[0], y = 2 * t->size[1], z = 2 * t->size[2];
  m->body_mass[body] = t->mass;
  m->body_inertia[3 * body + 0] = t->mass * (y * y + z * z) / 12;
  m->body_inertia[3 * body + 1] = t->mass * (x * x + z * z) / 12;
  m->body_inertia[3 * body + 2] = t->mass * (x * x + y * y) / 12;
  memcpy(m->body_ipos + 3 * body, t->com, sizeof t->com);
  memcpy(m->geom_size + 3 * geom, t->size, sizeof t->size);
  m->geom_rbound[geom] = sqrt(t->size[0] * t->size[0] + t->size[1] * t->size[1] + t->size[2] * t->size[2]);
  memcpy(m->geom_aabb + 6 * geom + 3, t->size, sizeof t->size);
}

// The constants that contacts use of one free box, as mj_setConst computes them: mean inverse inertia seen by a force at
// the centre of mass and by a torque.
static void derive(mjModel* m, int body, const Theta* t) {
  const double* inertia = m->body_inertia + 3 * body;
  const double rotation = (1 / inertia[0] + 1 / inertia[1] + 1 / inertia[2]) / 3;
  m->body_subtreemass[body] = t->mass;
  m->body_invweight0[2 * body] = 1 / t->mass;
  m->body_invweight0[2 * body + 1] = rotation;
}

static void write_theta(World* w) {
  mjModel* m = w->m;
  set_box(m, w->object, w->object_geom, &w->object_theta);
  if (w->obstacle >= 0) {
    if (w->movable) {
      set_box(m, w->obstacle, w->object_geom + 1, &w->obstacle_theta);
    } else {
      memcpy(m->geom_size + 3 * (w->object_geom + 1), w->obstacle_theta.size, sizeof w->obstacle_theta.size);
    }
  }
  // Pairs in the order of the XML: table-object, table-obstacle, object-obstacle, tools-object, tools-obstacle.
  const double object = w->object_theta.friction, obstacle = w->obstacle_theta.friction;
  for (int i = 0; i < m->npair; i++) {
    const int a = m->pair_geom1[i], b = m->pair_geom2[i];
    double f = 1;
    for (int k = 0; k < 2; k++) {
      const int g = k ? b : a;
      const double of = g == 0 ? 1.0 : g <= w->tool_geoms ? 0.2 : g == w->object_geom ? object : obstacle;
      if (of < f) f = of;
    }
    m->pair_friction[5 * i] = m->pair_friction[5 * i + 1] = f;
  }
}

static void restore(World* w) {
  mjModel* m = w->m;
  mjData* d = w->d;
  write_theta(w);
  derive(m, w->object, &w->object_theta);
  if (w->obstacle >= 0 && w->movable) derive(m, w->obstacle, &w->obstacle_theta);
  memcpy(d->qpos, w->qpos0, sizeof(double) * (size_t)m->nq);
  memcpy(d->qvel, w->qvel0, sizeof(double) * (size_t)m->nv);
  memset(d->qacc_warmstart, 0, sizeof(double) * (size_t)m->nv);
  d->time = 0;
}

static void action(World* w, int substeps, double observation[10]) {
  mjModel* m = w->m;
  mjData* d = w->d;
  double force[3] = {0, 0, 0};
  const int total = CONTROL_STEPS * substeps;
  for (int k = 0; k < total; k++) {
    const double t = (double)k / total;
    d->qpos[0] = d->qpos[2] = d->qvel[0] = d->qvel[2] = 0;
    d->qpos[1] = TRAVEL * share(t);
    d->qvel[1] = TRAVEL * 3 * rate(t);
    mj_step(m, d);
    for (int i = 0; i < d->ncon; i++) {
      const mjContact* c = d->contact + i;
      const int first = c->geom[0] >= 1 && c->geom[0] <= w->tool_geoms;
      const int second = c->geom[1] >= 1 && c->geom[1] <= w->tool_geoms;
      if (!first && !second) continue;
      mjtNum f[6];
      mj_contactForce(m, d, i, f);
      const double sign = first ? -1.0 : 1.0;
      for (int j = 0; j < 3; j++) {
        force[j] += sign * (c->frame[j] * f[0] + c->frame[3 + j] * f[1] + c->frame[6 + j] * f[2]);
      }
    }
  }
  memcpy(observation, d->qpos + 3, 7 * sizeof(double));
  for (int j = 0; j < 3; j++) observation[7 + j] = force[j] / total;
}

static int compare(const void* a, const void* b) {
  const double x = *(const double*)a, y = *(const double*)b;
  return (x > y) - (x < y);
}

static double median(double* v, int n) {
  qsort(v, (size_t)n, sizeof *v, compare);
  return n % 2 ? v[n / 2] : (v[n / 2 - 1] + v[n / 2]) / 2;
}

int main(int argc, char** argv) {
  if (argc != 6) {
    fprintf(stderr, "usage: mujoco_bench MODEL.xml none|movable|fixed SUBSTEPS ACTIONS BATCHES\n");
    return 2;
  }
  const int substeps = atoi(argv[3]), actions = atoi(argv[4]), batches = atoi(argv[5]);
  char error[1000] = "";
  World w = {0};
  w.m = mj_loadXML(argv[1], NULL, error, sizeof error);
  if (!w.m || substeps < 1 || actions < 1 || batches < 1) {
    fprintf(stderr, "%s\n", error);
    return 2;
  }
  mjModel* m = w.m;
  m->opt.timestep = 1.0 / (60.0 * substeps);
  w.d = mj_makeData(m);
  w.movable = !strcmp(argv[2], "movable");
  w.object = mj_name2id(m, mjOBJ_BODY, "object");
  w.obstacle = mj_name2id(m, mjOBJ_BODY, "obstacle");
  w.object_geom = mj_name2id(m, mjOBJ_GEOM, "object");
  w.tool_geoms = w.object_geom - 1;
  w.object_theta = (Theta){0.5, {0, 0, 0}, {0.04, 0.04, 0.045}, 0.4};
  w.obstacle_theta = (Theta){1.0, {0, 0, 0}, {0.025, 0.025, 0.045}, 0.5};
  memcpy(w.qpos0, m->qpos0, sizeof(double) * (size_t)m->nq);

  // The closed forms of derive() against mj_setConst, with a theta of odd numbers.
  const Theta keep = w.object_theta;
  w.object_theta = (Theta){0.731, {0.004, -0.006, 0.003}, {0.031, 0.044, 0.051}, 0.37};
  restore(&w);
  double mine[3] = {m->body_invweight0[2 * w.object], m->body_invweight0[2 * w.object + 1],
                    m->body_subtreemass[w.object]};
  mj_setConst(m, w.d);
  const double theirs[3] = {m->body_invweight0[2 * w.object], m->body_invweight0[2 * w.object + 1],
                            m->body_subtreemass[w.object]};
  for (int i = 0; i < 3; i++) {
    if (fabs(mine[i] / theirs[i] - 1) > 1e-6) {
      fprintf(stderr, "constant %d: %.9g, mj_setConst says %.9g\n", i, mine[i], theirs[i]);
      return 4;
    }
  }
  w.object_theta = keep;
  write_theta(&w);
  mj_setConst(m, w.d);

  double o[10];
  double* medians = malloc(sizeof(double) * (size_t)batches);
  double* times = malloc(sizeof(double) * (size_t)actions);
  for (int i = 0; i < 100; i++) {
    restore(&w);
    action(&w, substeps, o);
  }
  for (int b = 0; b < batches; b++) {
    for (int i = 0; i < actions; i++) {
      const double start = now_us();
      restore(&w);
      action(&w, substeps, o);
      times[i] = now_us() - start;
    }
    medians[b] = median(times, actions);
  }
  for (int i = 0; i < actions; i++) {
    const double start = now_us();
    mj_setConst(m, w.d);
    times[i] = now_us() - start;
  }
  const double set_const = median(times, actions);
  for (int i = 0; i < actions; i++) {
    const double start = now_us();
    mj_resetData(m, w.d);
    times[i] = now_us() - start;
  }
  const double reset = median(times, actions);
  for (int i = 0; i < actions; i++) {
    const double start = now_us();
    restore(&w);
    times[i] = now_us() - start;
  }
  const double restoring = median(times, actions);
  printf("{\"object_y_m\": %.9g, \"force_y_n\": %.9g, \"set_const_us\": %.3f, \"reset_data_us\": %.3f, "
         "\"restore_us\": %.3f, \"batch_us\": [", o[1], o[8], set_const, reset, restoring);
  for (int b = 0; b < batches; b++) printf("%s%.3f", b ? ", " : "", medians[b]);
  printf("]}\n");
  free(times);
  free(medians);
  mj_deleteData(w.d);
  mj_deleteModel(m);
  return 0;
}
