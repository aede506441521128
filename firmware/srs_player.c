/* See srs_player.h. */
#include "srs_player.h"

#include <string.h>

void srs_read(void *to, const void *from, uint16_t bytes) {
#ifdef __AVR__
  (void)memcpy_P(to, from, bytes);
#else
  (void)memcpy(to, from, bytes);
#endif
}

int8_t srs_valve(const uint32_t *valves, uint8_t segment) {
  const uint32_t bits = (valves[segment / 16u] >> (2u * (segment % 16u))) & 3u;
  return (bits == 1u) ? 1 : ((bits == 2u) ? -1 : 0);
}

void srs_write_pins(const srs_pins *map, uint8_t segments, const uint32_t *valves,
                    void (*write)(uint8_t pin, uint8_t level)) {
  for (uint8_t s = 0; s < segments; ++s) {
    const int8_t state = srs_valve(valves, s);
    const uint8_t opened = (state == 1) ? map[s].left : map[s].right;
    const uint8_t closed = (state == 1) ? map[s].right : map[s].left;
    write(closed, map[s].inverted);
    write(opened, (uint8_t)((state != 0) ? 1u : 0u) ^ map[s].inverted);
  }
}

/* Whether no segment's two valves are open at once, and none beyond the last segment. */
static uint8_t is_safe(const uint32_t *valves, uint8_t segments) {
  for (uint8_t w = 0; w < (uint8_t)SRS_WORDS; ++w) {
    const uint8_t first = (uint8_t)(16u * w);
    const uint8_t here = (segments <= first) ? 0u : (uint8_t)(segments - first);
    const uint32_t unused = (here >= 16u) ? 0u : ~(((uint32_t)1u << (2u * here)) - 1u);
    if (((valves[w] & (valves[w] >> 1) & 0x55555555u) != 0u) || ((valves[w] & unused) != 0u)) { return 0u; }
  }
  return 1u;
}

static srs_event event_of(const srs_player *p, const srs_cycle *cycle, uint16_t index) {
  srs_event event;
  if (cycle->index == SRS_NONE) {
    event = p->sent[cycle->slot][index];
  } else {
    srs_read(&event, &p->program->events[cycle->gait.first_event + index], (uint16_t)sizeof event);
  }
  return event;
}

static srs_cycle cycle_of_gait(const srs_player *p, uint16_t index) {
  srs_cycle cycle;
  srs_read(&cycle.gait, &p->program->gaits[index], (uint16_t)sizeof cycle.gait);
  cycle.index = index;
  cycle.then = index;
  cycle.slot = 0u;
  return cycle;
}

/* Events must begin at tick 0, ascend within the period, and open no two valves of a segment. */
static uint8_t is_playable(const srs_player *p, const srs_cycle *cycle) {
  uint16_t least = 0;
  if ((cycle->gait.events == 0u) || (cycle->gait.pressure_pa > p->program->most_pa)) { return 0u; }
  for (uint16_t k = 0; k < cycle->gait.events; ++k) {
    const srs_event event = event_of(p, cycle, k);
    if (((k == 0u) && (event.tick != 0u)) || (event.tick < least) || (event.tick >= cycle->gait.period_ticks) ||
        !is_safe(event.valves, p->program->segments)) {
      return 0u;
    }
    least = (uint16_t)(event.tick + 1u);
  }
  return 1u;
}

static uint8_t is_valid(const srs_player *p) {
  const srs_program *g = p->program;
  if ((g->words != (uint8_t)SRS_WORDS) || (g->segments == 0u) || (g->segments > SRS_MAX_SEGMENTS) ||
      (g->gait_count == 0u) || (g->gait_count == SRS_NONE) || (g->tick_us == 0u)) {
    return 0u;
  }
  for (uint16_t k = 0; k < g->gait_count; ++k) {
    const srs_cycle cycle = cycle_of_gait(p, k);
    if (((uint32_t)cycle.gait.first_event + cycle.gait.events > g->event_count) || !is_playable(p, &cycle)) {
      return 0u;
    }
  }
  for (uint16_t k = 0; k < g->step_count; ++k) {
    srs_step step;
    srs_read(&step, &g->steps[k], (uint16_t)sizeof step);
    if ((step.gait >= g->gait_count) || (step.cycles == 0u)) { return 0u; }
  }
  return 1u;
}

srs_fault srs_player_init(srs_player *p, const srs_program *program) {
  (void)memset(p, 0, sizeof *p);
  p->program = program;
  p->step = SRS_NONE;
  for (uint8_t s = 0; s < SRS_MAX_SEGMENTS; ++s) { p->held[s] = 0xFFFFu; }
  if (!is_valid(p)) { p->fault = SRS_FAULT_PROGRAM; }
  return p->fault;
}

/* Begin a step of the plan; return its gait's cycle. */
static srs_cycle begin_step(srs_player *p, uint16_t index) {
  srs_step step;
  srs_read(&step, &p->program->steps[index], (uint16_t)sizeof step);
  p->step = index;
  p->step_left = (uint16_t)(step.cycles - 1u);
  return cycle_of_gait(p, step.gait);
}

static void enter(srs_player *p, srs_state state) {
  p->state = state;
  p->tick = 0;
}

static srs_fault refuse(srs_player *p, srs_fault why) {
  p->fault = why;
  return why;
}

/* Take a cycle as the next one; from the vented state the regulator settles first. */
static srs_fault accept(srs_player *p, const srs_cycle *cycle, uint8_t commanded) {
  p->fault = SRS_OK;
  p->commanded = commanded;
  p->silent = 0;
  if (p->state == SRS_VENTED) { enter(p, SRS_SETTLING); }
  p->has_pending = (uint8_t)((p->state == SRS_PLAYING) ? 1u : 0u);
  if (p->has_pending != 0u) {
    p->pending = *cycle;
  } else {
    p->now = *cycle;
  }
  return SRS_OK;
}

/* Whether any command that plays is refused now; if not, it ends a plan. */
static srs_fault not_now(srs_player *p) {
  if (p->fault == SRS_FAULT_PROGRAM) { return SRS_FAULT_PROGRAM; }
  return (p->state == SRS_VENTING) ? refuse(p, SRS_REFUSED_BUSY) : SRS_OK;
}

/* Whether a gait may follow a cycle. */
static uint8_t may_follow(const srs_player *p, uint16_t then) {
  return (uint8_t)((then == SRS_NONE) || (then < p->program->gait_count));
}

srs_fault srs_player_select(srs_player *p, uint16_t gait, uint16_t then) {
  const srs_fault why = not_now(p);
  srs_cycle cycle;
  if (why != SRS_OK) { return why; }
  if ((gait >= p->program->gait_count) || !may_follow(p, then)) { return refuse(p, SRS_REFUSED_GAIT); }
  cycle = cycle_of_gait(p, gait);
  cycle.then = then;
  p->step = SRS_NONE;
  return accept(p, &cycle, 1u);
}

srs_fault srs_player_cycle(srs_player *p, uint16_t then, uint16_t period_ticks, uint32_t pressure_pa,
                           const srs_event *events, uint16_t count) {
  const srs_fault why = not_now(p);
  srs_cycle cycle = {{period_ticks, 0u, count, pressure_pa, 0, 0}, SRS_NONE, then, 0u};
  if (why != SRS_OK) { return why; }
  if ((count > (uint16_t)SRS_MAX_EVENTS) || !may_follow(p, then)) { return refuse(p, SRS_REFUSED_CYCLE); }
  /* the slot that is being played stays as it is */
  cycle.slot = ((p->state != SRS_VENTED) && (p->now.index == SRS_NONE)) ? (uint8_t)(1u - p->now.slot) : 0u;
  if ((p->has_pending != 0u) && (p->pending.index == SRS_NONE) && (p->pending.slot == cycle.slot)) {
    p->has_pending = 0u; /* it is being replaced */
  }
  (void)memcpy(p->sent[cycle.slot], events, count * sizeof *events);
  if (!is_playable(p, &cycle)) { return refuse(p, SRS_REFUSED_CYCLE); }
  p->step = SRS_NONE;
  return accept(p, &cycle, 1u);
}

srs_fault srs_player_run(srs_player *p) {
  const srs_fault why = not_now(p);
  srs_cycle cycle;
  if (why != SRS_OK) { return why; }
  if ((p->program->step_count == 0u) || (p->state != SRS_VENTED)) { return refuse(p, SRS_REFUSED_PLAN); }
  cycle = begin_step(p, 0u);
  return accept(p, &cycle, 0u);
}

int64_t srs_distance(const srs_gait *gait, int16_t speed_mm_s, int16_t turn_rate_mrad_s) {
  const int64_t v = 10 * ((int64_t)gait->speed_mm_s - speed_mm_s);
  const int64_t w = (int64_t)gait->turn_rate_mrad_s - turn_rate_mrad_s; /* mrad/s on 0.1 m: 0.1 mm/s */
  return v * v + w * w;
}

uint16_t srs_nearest(const srs_program *program, int16_t speed_mm_s, int16_t turn_rate_mrad_s) {
  uint16_t best = SRS_NONE;
  int64_t least = SRS_NEAR + 1;
  for (uint16_t k = 0; (k < program->gait_count) && ((speed_mm_s != 0) || (turn_rate_mrad_s != 0)); ++k) {
    srs_gait gait;
    srs_read(&gait, &program->gaits[k], (uint16_t)sizeof gait);
    const int64_t far = srs_distance(&gait, speed_mm_s, turn_rate_mrad_s);
    if (far < least) {
      least = far;
      best = k;
    }
  }
  return best;
}

void srs_player_vent(srs_player *p) {
  p->has_pending = 0u;
  p->step = SRS_NONE;
  (void)memset(p->wanted, 0, sizeof p->wanted);
  if (p->state != SRS_VENTED) { enter(p, SRS_VENTING); }
}

/* The cycle is over: the pending cycle, the plan's next step, or the same gait again. */
static void next_cycle(srs_player *p) {
  if (p->has_pending != 0u) {
    p->now = p->pending;
    p->has_pending = 0u;
  } else if (p->step != SRS_NONE) {
    if (p->step_left > 0u) {
      --p->step_left;
    } else if ((uint16_t)(p->step + 1u) < p->program->step_count) {
      p->now = begin_step(p, (uint16_t)(p->step + 1u));
    } else {
      srs_player_vent(p);
    }
  } else if (p->now.then == SRS_NONE) {
    srs_player_vent(p);
  } else {
    p->now = cycle_of_gait(p, p->now.then);
  }
}

static void play(srs_player *p) {
  if (p->tick >= p->now.gait.period_ticks) {
    p->tick = 0;
    next_cycle(p);
  }
  if (p->state != SRS_PLAYING) { return; }
  if (p->tick == 0u) {
    p->event = 0;
    ++p->cycles;
  }
  if (p->event < p->now.gait.events) { /* the next one to come into force */
    const srs_event next = event_of(p, &p->now, p->event);
    if (next.tick <= p->tick) {
      (void)memcpy(p->wanted, next.valves, sizeof p->wanted);
      ++p->event;
    }
  }
  ++p->tick;
}

/* Move the regulator's set point; return whether it is there. */
static uint8_t regulate(srs_player *p, uint32_t target_pa) {
  const uint8_t up = (uint8_t)(p->pressure_pa < target_pa);
  const uint32_t left = up ? (target_pa - p->pressure_pa) : (p->pressure_pa - target_pa);
  const uint32_t step = ((p->program->slew_pa == 0u) || (left < p->program->slew_pa)) ? left : p->program->slew_pa;
  p->pressure_pa = up ? (p->pressure_pa + step) : (p->pressure_pa - step);
  return (uint8_t)(step == left);
}

/* Take the wanted valves over, each segment when its dwell is over; venting waits for nothing. */
static void switch_valves(srs_player *p) {
  if (!is_safe(p->wanted, p->program->segments)) {
    srs_player_vent(p);
    p->fault = SRS_FAULT_BOTH_VALVES;
  }
  for (uint8_t s = 0; s < p->program->segments; ++s) {
    const uint8_t w = (uint8_t)(s / 16u);
    const uint32_t bits = (uint32_t)3u << (2u * (s % 16u));
    const uint8_t change = (uint8_t)(((p->valves[w] ^ p->wanted[w]) & bits) != 0u);
    if (change && ((p->state == SRS_VENTING) || (p->held[s] >= p->program->dwell_ticks))) {
      p->valves[w] = (p->valves[w] & ~bits) | (p->wanted[w] & bits);
      p->held[s] = 0;
    } else if (change) {
      p->fault = SRS_FAULT_DWELL;
    }
    if (p->held[s] < 0xFFFFu) { ++p->held[s]; }
  }
}

void srs_player_tick(srs_player *p) {
  ++p->time;
  if (p->fault == SRS_FAULT_PROGRAM) {
    return; /* vented since boot */
  }
  if (p->silent < 0xFFFFu) { ++p->silent; }
  if ((p->commanded != 0u) && (p->silent > p->program->timeout_ticks) &&
      ((p->state == SRS_SETTLING) || (p->state == SRS_PLAYING))) {
    srs_player_vent(p);
    p->fault = SRS_FAULT_TIMEOUT;
  }
  switch (p->state) {
    case SRS_SETTLING:
      ++p->tick;
      if (regulate(p, p->now.gait.pressure_pa) && (p->tick > p->program->settle_ticks)) {
        enter(p, SRS_PLAYING);
        play(p);
      }
      break;
    case SRS_PLAYING:
      play(p);
      if (p->state == SRS_PLAYING) { (void)regulate(p, p->now.gait.pressure_pa); }
      break;
    case SRS_VENTING:
      ++p->tick;
      if (p->tick > p->program->vent_ticks) {
        enter(p, SRS_VENTED);
        p->commanded = 0u;
      }
      break;
    case SRS_VENTED:
    default:
      break;
  }
  if ((p->state == SRS_VENTING) || (p->state == SRS_VENTED)) { p->pressure_pa = 0u; }
  switch_valves(p);
}
