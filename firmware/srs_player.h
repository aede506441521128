/* Plays gaits and plans on the valves of a pneumatic snake: C99, no allocation, no recursion, string.h only.
 *
 * The program (gaits, and the steps of a plan) is a constant that `gait_opt --table` or `plan` generates. Call
 * srs_player_tick() once per tick of the program from one timer, then write p->valves to the pins and
 * p->pressure_pa to the regulator. All other functions are called from the same context, between ticks.
 *
 * A valve mask holds two bits per segment, segment 1 (tail) lowest: 1 left chamber to supply, 2 right chamber
 * to supply, 0 both chambers to the air. 3 is never written.
 */
#ifndef SRS_PLAYER_H
#define SRS_PLAYER_H
#include <stdint.h>

#ifndef SRS_WORDS
#define SRS_WORDS 1 /* 32-bit words per mask; one word holds 16 segments */
#endif
#ifndef SRS_MAX_EVENTS
#define SRS_MAX_EVENTS 40 /* of a cycle that is sent over the line */
#endif
#define SRS_MAX_SEGMENTS (16u * SRS_WORDS)
#define SRS_NONE 0xFFFFu

/* The program lies in flash; on AVR that is another address space, so it is read through srs_read() only. */
#ifdef __AVR__
#include <avr/pgmspace.h>
#define SRS_FLASH PROGMEM
#else
#define SRS_FLASH
#endif

/* From `tick` on, counted from the start of the cycle, the valves stand as `valves` says. */
typedef struct {
  uint16_t tick;
  uint32_t valves[SRS_WORDS];
} srs_event;

typedef struct {
  uint16_t period_ticks;
  uint16_t first_event; /* index into the program's events */
  uint16_t events;
  uint32_t pressure_pa;
  int16_t speed_mm_s;       /* backwards: below 0 */
  int16_t turn_rate_mrad_s; /* to the left: above 0 */
} srs_gait;

/* Of a plan: a gait (a joining cycle is a gait like any other) and for how many cycles. */
typedef struct {
  uint16_t gait;
  uint16_t cycles;
} srs_step;

typedef struct {
  uint32_t id;      /* of the table or plan; the pilot refuses a robot that holds another */
  uint32_t tick_us; /* period of the timer */
  uint8_t segments;
  uint8_t words; /* SRS_WORDS that the program was generated for */
  uint16_t gait_count;
  uint16_t event_count;
  uint16_t step_count;
  uint16_t dwell_ticks;   /* a valve stays at least so long, but for an emergency */
  uint16_t settle_ticks;  /* of the regulator before the first cycle */
  uint16_t vent_ticks;    /* until vented chambers are straight */
  uint16_t timeout_ticks; /* without a word from the pilot: vent */
  uint32_t most_pa;       /* a gait or cycle that asks for more is refused */
  uint32_t slew_pa;       /* of the regulator's set point per tick; 0: at once */
  const srs_gait *gaits;
  const srs_event *events;
  const srs_step *steps;
} srs_program;

typedef enum { SRS_VENTED = 0, SRS_SETTLING = 1, SRS_PLAYING = 2, SRS_VENTING = 3 } srs_state;

typedef enum {
  SRS_OK = 0,
  SRS_FAULT_PROGRAM = 1,     /* the program is not valid: nothing is ever played */
  SRS_FAULT_BOTH_VALVES = 2, /* a mask would open both valves of a segment: vented */
  SRS_FAULT_TIMEOUT = 3,     /* no word from the pilot: vented */
  SRS_FAULT_DWELL = 4,       /* a switch came before the dwell was over: delayed */
  SRS_REFUSED_GAIT = 5,      /* no such gait */
  SRS_REFUSED_CYCLE = 6,     /* a cycle sent over the line is not valid */
  SRS_REFUSED_BUSY = 7,      /* still venting */
  SRS_REFUSED_PLAN = 8,      /* the program holds no plan, or the robot is not vented */
  SRS_REFUSED_MESSAGE = 9    /* no such message */
} srs_fault;

/* One cycle as it is played: from the program, or sent over the line. */
typedef struct {
  srs_gait gait;
  uint16_t index; /* of the gait; SRS_NONE: sent over the line */
  uint16_t then;  /* gait after it; SRS_NONE: vent */
  uint8_t slot;   /* of `sent` */
} srs_cycle;

typedef struct {
  const srs_program *program;
  srs_state state;
  srs_fault fault; /* the last one; cleared by every command that is accepted */
  srs_cycle now, pending;
  uint8_t has_pending;
  uint8_t commanded;  /* the timeout is watched */
  uint16_t step;      /* of the plan; SRS_NONE: no plan is running */
  uint16_t step_left; /* cycles of the step that are still to come */
  uint16_t tick;      /* within the cycle, or of settling and venting */
  uint16_t event;     /* of the cycle, next to come into force */
  uint16_t silent;    /* ticks since the pilot's last word; whoever hears it sets it to 0 */
  uint32_t cycles;    /* started since boot */
  uint32_t time;      /* ticks since boot */
  uint32_t valves[SRS_WORDS]; /* to be written */
  uint32_t wanted[SRS_WORDS];
  uint32_t pressure_pa; /* set point to be written */
  uint16_t held[SRS_MAX_SEGMENTS]; /* ticks since each segment's valves last changed */
  srs_event sent[2][SRS_MAX_EVENTS];
} srs_player;

/* Read from the program in flash. */
void srs_read(void *to, const void *from, uint16_t bytes);

/* Start vented. Checks the whole program; SRS_FAULT_PROGRAM stays until another program is loaded. */
srs_fault srs_player_init(srs_player *p, const srs_program *program);

/* Play one cycle of a gait from the next cycle's end on (after settling when vented), then the gait `then`:
 * the same gait to go on until told otherwise, SRS_NONE to vent unless told otherwise in time. */
srs_fault srs_player_select(srs_player *p, uint16_t gait, uint16_t then);

/* The same for a cycle that is in no program. */
srs_fault srs_player_cycle(srs_player *p, uint16_t then, uint16_t period_ticks, uint32_t pressure_pa,
                           const srs_event *events, uint16_t count);

/* Run the program's plan from its start; no pilot is needed. */
srs_fault srs_player_run(srs_player *p);

/* Vent at the next tick, whatever is being played. */
void srs_player_vent(srs_player *p);

/* One tick of the timer. */
void srs_player_tick(srs_player *p);

/* The gait nearest to a wanted motion, 1 rad/s counting as 0.1 m/s; SRS_NONE, which is to vent, for standing
 * still and where no gait is within 50 mm/s. */
uint16_t srs_nearest(const srs_program *program, int16_t speed_mm_s, int16_t turn_rate_mrad_s);

/* Squared distance of a gait's steady motion from a wanted one, in units of 0.1 mm/s, and the largest that is near. */
int64_t srs_distance(const srs_gait *gait, int16_t speed_mm_s, int16_t turn_rate_mrad_s);
#define SRS_NEAR 250000

/* State of one segment (from 0, the tail): 1 left, -1 right, 0 vented. */
int8_t srs_valve(const uint32_t *valves, uint8_t segment);

/* Pins of one segment's two valves; a level of 1 opens a valve unless `inverted`. */
typedef struct {
  uint8_t left, right, inverted;
} srs_pins;

/* Write a mask to the pins; of each segment the valve that closes goes first. */
void srs_write_pins(const srs_pins *map, uint8_t segments, const uint32_t *valves,
                    void (*write)(uint8_t pin, uint8_t level));
#endif
