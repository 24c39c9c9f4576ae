/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * A simulated motor behind an RMD drive: it follows every command without inertia, and forgets its
 * settings at power-off. Include it after motorlink.h and a declaration of now_us().
 */
#ifndef MOTORLINK_EXAMPLE_MOTOR_H
#define MOTORLINK_EXAMPLE_MOTOR_H

enum { COUNTS = 1 << 14, OWN_SPEED_DPS = 360 };

struct motor {
  motorlink_rmd_motion motion;
  uint64_t seen_us;
  /* In millionths of a count, so that slow is not still. */
  int64_t position;
  int16_t speed_dps;
};

static int64_t counts_of(int64_t dps, uint64_t us) {
  return dps * COUNTS / 360 * (int64_t)us;
}

/* Moves the motor to where it is now. */
static void turn(struct motor *motor) {
  const motorlink_rmd_motion *motion = &motor->motion;
  uint64_t now = now_us(), passed = now - motor->seen_us;
  int64_t dps = 0, target = motion->target_counts * 1000000;
  motor->seen_us = now;
  if (motion->kind == MOTORLINK_RMD_MODE_SPEED) {
    dps = motion->speed_centidps / 100;
  } else if (motion->kind == MOTORLINK_RMD_MODE_POSITION) {
    int64_t most = motion->max_speed_dps >= 0 ? motion->max_speed_dps : OWN_SPEED_DPS;
    int64_t way = target - motor->position, reach = counts_of(most, passed);
    if (way <= reach && way >= -reach) {
      motor->position = target;
    } else {
      dps = way > 0 ? most : -most;
    }
  }
  motor->position += counts_of(dps, passed);
  motor->speed_dps = (int16_t)(dps > 2000 ? 2000 : dps < -2000 ? -2000 : dps);
}

static void set_mode(void *context, const motorlink_rmd_motion *motion) {
  struct motor *motor = (struct motor *)context;
  turn(motor);
  motor->motion = *motion;
}

static void sense(void *context, motorlink_rmd_sense *out) {
  struct motor *motor = (struct motor *)context;
  turn(motor);
  out->encoder_counts = motor->position / 1000000;
  out->speed_dps = motor->speed_dps;
  out->voltage_decivolts = 240;
  out->temperature_celsius = 25;
  if (motor->motion.kind == MOTORLINK_RMD_MODE_TORQUE) {
    /* 0.016 A a digit became 33/2048 A a digit. */
    out->iq_digits = (int16_t)((int32_t)motor->motion.iq_16ma * 2048 * 16 / 33000);
  }
}

/* The table of callbacks for the drive. The motor's time begins now. */
static motorlink_rmd_motor_control motor_control(struct motor *motor) {
  motorlink_rmd_motor_control callbacks;
  memset(&callbacks, 0, sizeof callbacks);
  callbacks.context = motor;
  callbacks.set_mode = set_mode;
  callbacks.sense = sense;
  motor->seen_us = now_us();
  return callbacks;
}

#endif
