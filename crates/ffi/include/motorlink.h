/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/* Written by `make header` from crates/ffi and from the protocols' tables: do not edit. */

/**
 * Motorlink: both ends of two protocols for motor drives. ST's serial Motor Control Protocol as
 * MCSDK 5.x drives speak it, master and slave; the RMD motor control protocol over CAN, V1.62,
 * host and drive; and slcan, with which a serial line carries CAN frames. C99 and C++11.
 * Paragraph numbers in brackets are those of the protocols' documents.
 *
 * The library reads no clock, opens no port, allocates nothing and prints nothing. Hand in received
 * bytes or frames with the time of their arrival, and poll for what to do: send, wait, or take the
 * result. The manual with examples, C.md, and the pages that this header cites are installed in
 * share/doc/motorlink.
 *
 *     static motorlink_st_master master;
 *     motorlink_st_output output;
 *
 *     check(motorlink_st_master_init(&master, sizeof master, NULL));
 *     check(motorlink_st_master_get_register(&master, 1, MOTORLINK_ST_REG_SPEED_MEAS));
 *     do {
 *       check(motorlink_st_master_poll(&master, now_us(), &output));
 *       if (output.kind == MOTORLINK_OUTPUT_TRANSMIT) {
 *         send(output.bytes.data, output.bytes.size);
 *       } else if (output.kind == MOTORLINK_OUTPUT_WAIT) {
 *         size_t size = receive_until(output.until_us, buffer, sizeof buffer);
 *         check(motorlink_st_master_receive(&master, now_us(), buffer, size));
 *       }
 *     } while (output.kind != MOTORLINK_OUTPUT_DONE);
 *     check(output.result);
 *     speed_rpm = output.value;
 *
 * `check` is yours: it leaves the loop if its argument is not MOTORLINK_OK. A call with a wrong argument
 * begins no exchange, and a loop that waits for its end then waits forever.
 *
 * For every function:
 *
 * Version. MOTORLINK_VERSION and its numbers are those of this header, for `#if`. Before 1.0 each
 * minor version is another interface. To compare header and library at run time:
 * `strcmp(motorlink_version(), MOTORLINK_VERSION) == 0`.
 *
 * Ownership. The caller owns the storage of every object: static, on the stack or on the heap. It is
 * opaque. `_init` begins an object there, whatever the storage held before. There is nothing to
 * release. A function uses a pointer during the call only, unless its description says that the
 * pointer is kept. Pointers in one call must not overlap one another or an object's storage, unless the
 * description says that they may. An output or a reply points to bytes in the storage of the object. The
 * next call for the object overwrites them: send or copy them before, also before a transfer by DMA.
 *
 * Requests. A `motorlink_st_master_` function that takes a motor begins an exchange. `_poll`
 * conducts it: send what it gives, hand in what arrives, until it gives DONE. Until then every other
 * request is BUSY. `motor` is 1 to 7, or 0 for the drive's current motor (3.2). BAD_ARGUMENT: `motor`
 * is over 7. BUSY: an exchange is under way. The host of RMD motors has an exchange with each motor,
 * all at the same time. LIMIT, of both: the request exceeds a limit that the caller set, for a master
 * with `motorlink_st_master_set_limits`; a start without an acknowledged ramp under a limit of speed; for
 * RMD also a value outside of the document's range.
 *
 * Numbers with names. Registers, commands, error codes, states and the like have an enum each. Its name
 * is the type in calls. The type has one byte, with -fshort-enums and without. In C it is `uint8_t`; from
 * C23 on and in C++ it is the enum itself, so that C++ needs a cast for a plain number. A drive may send
 * a number without a name: it is handed on unchanged. A caller may pass a register or a command without
 * a name; other numbers without a name give BAD_ARGUMENT. Sums of bits are plain integers.
 *
 * Time is in microseconds since any moment. Use the same clock for all calls of an object. Time must
 * not run backwards: a counter of 32 bits wraps around after 71 minutes, and a tick of milliseconds is not
 * in microseconds. Extend it to 64 bits; C.md has the lines. If time runs backwards all the same, waits
 * end: an exchange with TIMEOUT, and an RMD drive with a shutdown time switches its motor off.
 *
 * Errors. A function returns MOTORLINK_OK, or another `motorlink_error`: then it has done nothing.
 * Any function may return NULL_POINTER and MISALIGNED, and, if it takes an object, UNINITIALISED,
 * WRONG_KIND and IN_USE. `_init` may return STORAGE_TOO_SMALL. Each function names its other errors.
 *
 * Reentrancy. Calls for different objects are independent; there are no globals. A call for an object
 * that is in a call already (from one of its callbacks, from an interrupt, from another thread)
 * returns IN_USE and does nothing. The bytes of that call are lost, so do not hand in bytes from an
 * interrupt: put them into a ring, which the main loop empties. On a processor without compare-and-exchange, such as a Cortex-M0,
 * this holds for callbacks and interrupts only. `_init` cannot detect it and must not be called then.
 *
 * Callbacks must return: not leave by longjmp or by a C++ exception. The program may change the table
 * of callbacks at any time, also in a callback.
 *
 * Panic. There is none: no check inside the library can fail. The library for microcontrollers is
 * installed only if its code refers to no panic handler.
 *
 * Cost. The number of steps of a call depends only on the bytes that were handed in and on the callbacks.
 * On a Cortex-M4 a call needs less than 1 KiB of stack beside its callbacks; only
 * motorlink_rmd_host_init needs 6 KiB. Functions that are not called are not linked.
 */


#ifndef MOTORLINK_H
#define MOTORLINK_H

#include <stddef.h>
#include <stdint.h>

/** Version of this header. `motorlink_version` tells the library's. */
#define MOTORLINK_VERSION_MAJOR 0
#define MOTORLINK_VERSION_MINOR 1
#define MOTORLINK_VERSION_PATCH 0
/** The same as text. */
#define MOTORLINK_VERSION "0.1.0"

/** How a drive behaves where the document and shipped firmware differ. */
enum motorlink_st_profile
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_ST_PROFILE_SPEC    = 0x00, /**< the document as written */
  MOTORLINK_ST_PROFILE_MCSDK54 = 0x01  /**< what firmware of MCSDK 5.4 does on the wire */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_st_profile motorlink_st_profile;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_st_profile;
#endif

/** How a master recovers a line after it was opened, or after a failed exchange. */
enum motorlink_st_recovery
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_ST_RECOVERY_DRAIN = 0x00, /**< waits for silence, asks a question, continues after the answer */
  MOTORLINK_ST_RECOVERY_PAD   = 0x01, /**< sends bytes that complete a frame for which a 5.x drive may still wait, then as DRAIN */
  MOTORLINK_ST_RECOVERY_NONE  = 0x02  /**< never recovers. The line counts as in sync from the start, so that a late reply to an earlier program is taken for the reply to the first request. After a failure it is out of sync until `motorlink_st_master_trust_line` is called */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_st_recovery motorlink_st_recovery;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_st_recovery;
#endif

/** Registers (table 3). A comment has access (D: for the DAC only), type and unit. Units: 32767 s16A is full scale of the drive's current measurement, 32767 s16V full scale of its voltage, 65536 s16degree one electrical turn. */
enum motorlink_st_reg
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_ST_REG_TARGET_MOTOR          = 0x00, /**< RW u8: Motor that motor number 0 addresses; the value 0 is motor 1 */
  MOTORLINK_ST_REG_FLAGS                 = 0x01, /**< R  u32: Faults: low half occurred, high half present */
  MOTORLINK_ST_REG_STATUS                = 0x02, /**< R  u8: State of the state machine */
  MOTORLINK_ST_REG_CONTROL_MODE          = 0x03, /**< RW u8: Torque (0) or speed (1) control */
  MOTORLINK_ST_REG_SPEED_REF             = 0x04, /**< R  i32 rpm: Speed reference */
  MOTORLINK_ST_REG_SPEED_KP              = 0x05, /**< RW i16 s16A/unit: Speed regulator Kp, numerator */
  MOTORLINK_ST_REG_SPEED_KI              = 0x06, /**< RW i16 s16A/unit: Speed regulator Ki, numerator */
  MOTORLINK_ST_REG_SPEED_KD              = 0x07, /**< RW i16 s16A/unit: Speed regulator Kd, numerator */
  MOTORLINK_ST_REG_TORQUE_REF            = 0x08, /**< RW i16 s16A: Iq reference */
  MOTORLINK_ST_REG_TORQUE_KP             = 0x09, /**< RW i16 s16V/s16A: Iq regulator Kp, numerator */
  MOTORLINK_ST_REG_TORQUE_KI             = 0x0A, /**< RW i16 s16V/s16A: Iq regulator Ki, numerator */
  MOTORLINK_ST_REG_TORQUE_KD             = 0x0B, /**< RW i16 s16V/s16A: Iq regulator Kd, numerator */
  MOTORLINK_ST_REG_FLUX_REF              = 0x0C, /**< RW i16 s16A: Id reference */
  MOTORLINK_ST_REG_FLUX_KP               = 0x0D, /**< RW i16 s16V/s16A: Id regulator Kp, numerator */
  MOTORLINK_ST_REG_FLUX_KI               = 0x0E, /**< RW i16 s16V/s16A: Id regulator Ki, numerator */
  MOTORLINK_ST_REG_FLUX_KD               = 0x0F, /**< RW i16 s16V/s16A: Id regulator Kd, numerator */
  MOTORLINK_ST_REG_OBSERVER_C1           = 0x10, /**< RW i16: Observer gain C1 (PLL) */
  MOTORLINK_ST_REG_OBSERVER_C2           = 0x11, /**< RW i16: Observer gain C2 (PLL) */
  MOTORLINK_ST_REG_OBSERVER_CR_C1        = 0x12, /**< RW i16: Observer gain C1 (CORDIC) */
  MOTORLINK_ST_REG_OBSERVER_CR_C2        = 0x13, /**< RW i16: Observer gain C2 (CORDIC) */
  MOTORLINK_ST_REG_PLL_KI                = 0x14, /**< RW i16 dpp/s16V: PLL regulator Ki, numerator */
  MOTORLINK_ST_REG_PLL_KP                = 0x15, /**< RW i16 dpp/s16V: PLL regulator Kp, numerator */
  MOTORLINK_ST_REG_FLUXWK_KP             = 0x16, /**< RW i16 s16A/s16V²: Flux weakening regulator Kp */
  MOTORLINK_ST_REG_FLUXWK_KI             = 0x17, /**< RW i16 s16A/s16V²: Flux weakening regulator Ki */
  MOTORLINK_ST_REG_FLUXWK_BUS            = 0x18, /**< RW u16 %: Share of the bus voltage that flux weakening may use (mcsdk-5.4: 0.1 %) */
  MOTORLINK_ST_REG_BUS_VOLTAGE           = 0x19, /**< R  u16 V: Bus voltage */
  MOTORLINK_ST_REG_HEATS_TEMP            = 0x1A, /**< R  u16 °C: Heatsink temperature (mcsdk-5.4: i16) */
  MOTORLINK_ST_REG_MOTOR_POWER           = 0x1B, /**< R  u16 W: Electrical power into the motor (mcsdk-5.4: i16) */
  MOTORLINK_ST_REG_DAC_OUT1              = 0x1C, /**< RW u8: Register shown on DAC channel 1 */
  MOTORLINK_ST_REG_DAC_OUT2              = 0x1D, /**< RW u8: Register shown on DAC channel 2 */
  MOTORLINK_ST_REG_SPEED_MEAS            = 0x1E, /**< R  i32 rpm: Mechanical speed, averaged */
  MOTORLINK_ST_REG_TORQUE_MEAS           = 0x1F, /**< R  i16 s16A: Iq, measured */
  MOTORLINK_ST_REG_FLUX_MEAS             = 0x20, /**< R  i16 s16A: Id, measured */
  MOTORLINK_ST_REG_FLUXWK_BUS_MEAS       = 0x21, /**< R  u16 %: Share of the bus voltage in use (mcsdk-5.4: 0.1 %) */
  MOTORLINK_ST_REG_RUC_STAGE_NBR         = 0x22, /**< R  u8: Number of rev-up phases */
  MOTORLINK_ST_REG_I_A                   = 0x23, /**< D  i16 s16A: Phase A current */
  MOTORLINK_ST_REG_I_B                   = 0x24, /**< D  i16 s16A: Phase B current */
  MOTORLINK_ST_REG_I_ALPHA               = 0x25, /**< D  i16 s16A: Alpha current */
  MOTORLINK_ST_REG_I_BETA                = 0x26, /**< D  i16 s16A: Beta current */
  MOTORLINK_ST_REG_I_Q                   = 0x27, /**< D  i16 s16A: Iq, measured */
  MOTORLINK_ST_REG_I_D                   = 0x28, /**< D  i16 s16A: Id, measured */
  MOTORLINK_ST_REG_I_Q_REF               = 0x29, /**< D  i16 s16A: Iq reference */
  MOTORLINK_ST_REG_I_D_REF               = 0x2A, /**< D  i16 s16A: Id reference */
  MOTORLINK_ST_REG_V_Q                   = 0x2B, /**< D  i16 s16V: Vq */
  MOTORLINK_ST_REG_V_D                   = 0x2C, /**< D  i16 s16V: Vd */
  MOTORLINK_ST_REG_V_ALPHA               = 0x2D, /**< D  i16 s16V: Alpha voltage */
  MOTORLINK_ST_REG_V_BETA                = 0x2E, /**< D  i16 s16V: Beta voltage */
  MOTORLINK_ST_REG_MEAS_EL_ANGLE         = 0x2F, /**< D  i16 s16degree: Electrical angle from the sensor */
  MOTORLINK_ST_REG_MEAS_ROT_SPEED        = 0x30, /**< D  i16 s16speed: Mechanical speed from the sensor */
  MOTORLINK_ST_REG_OBS_EL_ANGLE          = 0x31, /**< D  i16 s16degree: Observed electrical angle (PLL) */
  MOTORLINK_ST_REG_OBS_ROT_SPEED         = 0x32, /**< D  i16 s16speed: Observed mechanical speed (PLL) */
  MOTORLINK_ST_REG_OBS_I_ALPHA           = 0x33, /**< D  i16 s16A: Estimated alpha current (PLL) */
  MOTORLINK_ST_REG_OBS_I_BETA            = 0x34, /**< D  i16 s16A: Estimated beta current (PLL) */
  MOTORLINK_ST_REG_OBS_BEMF_ALPHA        = 0x35, /**< D  i16 s16V: Observed back-EMF, alpha (PLL) */
  MOTORLINK_ST_REG_OBS_BEMF_BETA         = 0x36, /**< D  i16 s16V: Observed back-EMF, beta (PLL) */
  MOTORLINK_ST_REG_OBS_CR_EL_ANGLE       = 0x37, /**< D  i16 s16degree: Observed electrical angle (CORDIC) */
  MOTORLINK_ST_REG_OBS_CR_ROT_SPEED      = 0x38, /**< D  i16 s16speed: Observed mechanical speed (CORDIC) */
  MOTORLINK_ST_REG_OBS_CR_I_ALPHA        = 0x39, /**< D  i16 s16A: Estimated alpha current (CORDIC) */
  MOTORLINK_ST_REG_OBS_CR_I_BETA         = 0x3A, /**< D  i16 s16A: Estimated beta current (CORDIC) */
  MOTORLINK_ST_REG_OBS_CR_BEMF_ALPHA     = 0x3B, /**< D  i16 s16V: Observed back-EMF, alpha (CORDIC) */
  MOTORLINK_ST_REG_OBS_CR_BEMF_BETA      = 0x3C, /**< D  i16 s16V: Observed back-EMF, beta (CORDIC) */
  MOTORLINK_ST_REG_DAC_USER1             = 0x3D, /**< D  i16: User value of DAC channel 1 */
  MOTORLINK_ST_REG_DAC_USER2             = 0x3E, /**< D  i16: User value of DAC channel 2 */
  MOTORLINK_ST_REG_MAX_APP_SPEED         = 0x3F, /**< R  u32 rpm: Highest speed of the application */
  MOTORLINK_ST_REG_MIN_APP_SPEED         = 0x40, /**< R  u32 rpm: Lowest speed of the application */
  MOTORLINK_ST_REG_IQ_SPEEDMODE          = 0x41, /**< W  i16 s16A: Id reference in speed mode; the document also says Iq (S22) */
  MOTORLINK_ST_REG_EST_BEMF_LEVEL        = 0x42, /**< R  i16 s16V²: Expected back-EMF level (PLL) */
  MOTORLINK_ST_REG_OBS_BEMF_LEVEL        = 0x43, /**< R  i16 s16V²: Observed back-EMF level (PLL) */
  MOTORLINK_ST_REG_EST_CR_BEMF_LEVEL     = 0x44, /**< R  i16 s16V²: Expected back-EMF level (CORDIC) */
  MOTORLINK_ST_REG_OBS_CR_BEMF_LEVEL     = 0x45, /**< R  i16 s16V²: Observed back-EMF level (CORDIC) */
  MOTORLINK_ST_REG_FF_1Q                 = 0x46, /**< RW i32: Feed-forward constant C1q */
  MOTORLINK_ST_REG_FF_1D                 = 0x47, /**< RW i32: Feed-forward constant C1d */
  MOTORLINK_ST_REG_FF_2                  = 0x48, /**< RW i32: Feed-forward constant C2 */
  MOTORLINK_ST_REG_FF_VQ                 = 0x49, /**< R  i16 s16V: Feed-forward part of Vq */
  MOTORLINK_ST_REG_FF_VD                 = 0x4A, /**< R  i16 s16V: Feed-forward part of Vd */
  MOTORLINK_ST_REG_FF_VQ_PIOUT           = 0x4B, /**< R  i16 s16V: Regulator part of Vq */
  MOTORLINK_ST_REG_FF_VD_PIOUT           = 0x4C, /**< R  i16 s16V: Regulator part of Vd */
  MOTORLINK_ST_REG_PFC_STATUS            = 0x4D, /**< R  i8: PFC state */
  MOTORLINK_ST_REG_PFC_FAULTS            = 0x4E, /**< R  u32: PFC faults */
  MOTORLINK_ST_REG_PFC_DCBUS_REF         = 0x4F, /**< RW i16 V: PFC bus voltage reference */
  MOTORLINK_ST_REG_PFC_DCBUS_MEAS        = 0x50, /**< R  i16 V: PFC bus voltage */
  MOTORLINK_ST_REG_PFC_ACBUS_FREQ        = 0x51, /**< R  i16 0.1 Hz: Mains frequency */
  MOTORLINK_ST_REG_PFC_ACBUS_RMS         = 0x52, /**< R  i16 V: Mains voltage, zero to peak */
  MOTORLINK_ST_REG_PFC_I_KP              = 0x53, /**< RW i16 s16V/s16A: PFC current regulator Kp */
  MOTORLINK_ST_REG_PFC_I_KI              = 0x54, /**< RW i16 s16V/s16A: PFC current regulator Ki */
  MOTORLINK_ST_REG_PFC_I_KD              = 0x55, /**< RW i16 s16V/s16A: PFC current regulator Kd */
  MOTORLINK_ST_REG_PFC_V_KP              = 0x56, /**< RW i16 s16A/V: PFC voltage regulator Kp */
  MOTORLINK_ST_REG_PFC_V_KI              = 0x57, /**< RW i16 s16A/V: PFC voltage regulator Ki */
  MOTORLINK_ST_REG_PFC_V_KD              = 0x58, /**< RW i16 s16A/V: PFC voltage regulator Kd */
  MOTORLINK_ST_REG_PFC_STARTUP_DURATION  = 0x59, /**< RW i16 ms: Length of the PFC start-up */
  MOTORLINK_ST_REG_PFC_ENABLED           = 0x5A, /**< R  i8: Whether the PFC is enabled */
  MOTORLINK_ST_REG_RAMP_FINAL_SPEED      = 0x5B, /**< RW i32 rpm: Final speed of the ramp */
  MOTORLINK_ST_REG_RAMP_DURATION         = 0x5C, /**< -  u16 ms: Length of the ramp (firmware only) */
  MOTORLINK_ST_REG_HFI_EL_ANGLE          = 0x5D, /**< R  i16 s16degree: Electrical angle from HFI (firmware only) */
  MOTORLINK_ST_REG_HFI_ROT_SPEED         = 0x5E, /**< R  i16 s16speed: Mechanical speed from HFI (firmware only) */
  MOTORLINK_ST_REG_HFI_CURRENT           = 0x5F, /**< R  i16 s16A: HFI current (firmware only) */
  MOTORLINK_ST_REG_HFI_INIT_ANG_PLL      = 0x60, /**< R  i16 s16degree: Initial angle from the HFI PLL (firmware only) */
  MOTORLINK_ST_REG_HFI_INIT_ANG_SAT_DIFF = 0x61, /**< RW i16: Initial angle saturation difference (firmware only) */
  MOTORLINK_ST_REG_HFI_PI_PLL_KP         = 0x62, /**< -  i16: HFI PLL Kp (firmware only) */
  MOTORLINK_ST_REG_HFI_PI_PLL_KI         = 0x63, /**< -  i16: HFI PLL Ki (firmware only) */
  MOTORLINK_ST_REG_HFI_PI_TRACK_KP       = 0x64, /**< RW i16: HFI tracking Kp (firmware only) */
  MOTORLINK_ST_REG_HFI_PI_TRACK_KI       = 0x65, /**< RW i16: HFI tracking Ki (firmware only) */
  MOTORLINK_ST_REG_SC_CHECK              = 0x66, /**< R  u8: Profiler is built in (firmware only) */
  MOTORLINK_ST_REG_SC_STATE              = 0x67, /**< R  u8: Profiler state (firmware only) */
  MOTORLINK_ST_REG_SC_RS                 = 0x68, /**< R  f32 Ω: Profiler: stator resistance (firmware only) */
  MOTORLINK_ST_REG_SC_LS                 = 0x69, /**< R  f32 H: Profiler: stator inductance (firmware only) */
  MOTORLINK_ST_REG_SC_KE                 = 0x6A, /**< R  f32: Profiler: back-EMF constant (firmware only) */
  MOTORLINK_ST_REG_SC_VBUS               = 0x6B, /**< R  f32 V: Profiler: bus voltage (firmware only) */
  MOTORLINK_ST_REG_SC_MEAS_NOMINALSPEED  = 0x6C, /**< R  f32 rpm: Profiler: measured nominal speed (firmware only) */
  MOTORLINK_ST_REG_SC_STEPS              = 0x6D, /**< R  u8: Profiler: number of steps (firmware only) */
  MOTORLINK_ST_REG_SPEED_KP_DIV          = 0x6E, /**< R  i16: Speed regulator Kp, divisor */
  MOTORLINK_ST_REG_SPEED_KI_DIV          = 0x6F, /**< R  i16: Speed regulator Ki, divisor */
  MOTORLINK_ST_REG_UID                   = 0x70, /**< R  u32: Unique identification (firmware only) */
  MOTORLINK_ST_REG_HWTYPE                = 0x71, /**< -  i16: Hardware type (firmware only) */
  MOTORLINK_ST_REG_CTRBID                = 0x72, /**< R  u32: Control board identification (mcsdk-5.4: u16) */
  MOTORLINK_ST_REG_PWBDID                = 0x73, /**< R  u32: Power board identification (mcsdk-5.4: u16) */
  MOTORLINK_ST_REG_SC_PP                 = 0x74, /**< RW u8: Profiler: pole pairs (firmware only) */
  MOTORLINK_ST_REG_SC_CURRENT            = 0x75, /**< RW f32 A: Profiler: current (firmware only) */
  MOTORLINK_ST_REG_SC_SPDBANDWIDTH       = 0x76, /**< RW f32: Profiler: speed bandwidth (firmware only) */
  MOTORLINK_ST_REG_SC_LDLQRATIO          = 0x77, /**< RW f32: Profiler: Ld/Lq ratio (firmware only) */
  MOTORLINK_ST_REG_SC_NOMINAL_SPEED      = 0x78, /**< RW u32 rpm: Profiler: nominal speed (firmware only) */
  MOTORLINK_ST_REG_SC_CURRBANDWIDTH      = 0x79, /**< RW f32: Profiler: current bandwidth (firmware only) */
  MOTORLINK_ST_REG_SC_J                  = 0x7A, /**< R  f32: Profiler: inertia (firmware only) */
  MOTORLINK_ST_REG_SC_F                  = 0x7B, /**< R  f32: Profiler: friction (firmware only) */
  MOTORLINK_ST_REG_SC_MAX_CURRENT        = 0x7C, /**< R  f32 A: Profiler: highest current (firmware only) */
  MOTORLINK_ST_REG_SC_STARTUP_SPEED      = 0x7D, /**< R  u32 rpm: Profiler: start-up speed (firmware only) */
  MOTORLINK_ST_REG_SC_STARTUP_ACC        = 0x7E, /**< R  u32: Profiler: start-up acceleration (firmware only) */
  MOTORLINK_ST_REG_SC_PWM_FREQUENCY      = 0x7F, /**< R  u32 Hz: Profiler: PWM frequency (firmware only) */
  MOTORLINK_ST_REG_SC_FOC_REP_RATE       = 0x80, /**< R  u8: Profiler: FOC repetition rate (firmware only) */
  MOTORLINK_ST_REG_PWBDID2               = 0x81, /**< R  u32: Power board identification, motor 2 */
  MOTORLINK_ST_REG_SC_COMPLETED          = 0x82, /**< R  u8: Profiler has completed (firmware only) */
  MOTORLINK_ST_REG_CURRENT_POSITION      = 0x83, /**< R  f32 rad: Position (firmware only) */
  MOTORLINK_ST_REG_TARGET_POSITION       = 0x84, /**< R  f32 rad: Target position (firmware only) */
  MOTORLINK_ST_REG_MOVE_DURATION         = 0x85, /**< R  f32 s: Duration of the move (firmware only) */
  MOTORLINK_ST_REG_POSITION_KP           = 0x86, /**< RW i16: Position regulator Kp (firmware only) */
  MOTORLINK_ST_REG_POSITION_KI           = 0x87, /**< RW i16: Position regulator Ki (firmware only) */
  MOTORLINK_ST_REG_POSITION_KD           = 0x88  /**< RW i16: Position regulator Kd (firmware only) */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_st_reg motorlink_st_reg;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_st_reg;
#endif

/** Frame codes (table 1). */
enum motorlink_st_frame_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_ST_FRAME_CODE_SET_REG           = 0x01, /**< write a register (4.4) */
  MOTORLINK_ST_FRAME_CODE_GET_REG           = 0x02, /**< read a register (4.5) */
  MOTORLINK_ST_FRAME_CODE_EXECUTE_CMD       = 0x03, /**< execute a command (4.6) */
  MOTORLINK_ST_FRAME_CODE_GET_BOARD_INFO    = 0x06, /**< read the SDK's version and name (4.7) */
  MOTORLINK_ST_FRAME_CODE_SET_RAMP          = 0x07, /**< program a speed ramp (4.8) */
  MOTORLINK_ST_FRAME_CODE_GET_REVUP_DATA    = 0x08, /**< read a rev-up phase (4.9) */
  MOTORLINK_ST_FRAME_CODE_SET_REVUP_DATA    = 0x09, /**< write a rev-up phase (4.10) */
  MOTORLINK_ST_FRAME_CODE_SET_CURRENT_REF   = 0x0A, /**< set the Iq and Id references (4.11) */
  MOTORLINK_ST_FRAME_CODE_GET_MP_INFO       = 0x0B, /**< list the registers of motor profiler steps (profile MCSDK 5.4 only) */
  MOTORLINK_ST_FRAME_CODE_GET_FW_VERSION    = 0x0C, /**< read the firmware's version string (4.12) */
  MOTORLINK_ST_FRAME_CODE_GET_DATA_ELEMENT  = 0x0D, /**< read a data segment (profile SPEC only) */
  MOTORLINK_ST_FRAME_CODE_SET_TORQUE_RAMP   = 0x0D, /**< program a torque ramp (profile MCSDK 5.4 only) */
  MOTORLINK_ST_FRAME_CODE_CONFIG_DYN_STRUCT = 0x0E, /**< choose the registers of a data segment (profile SPEC only) */
  MOTORLINK_ST_FRAME_CODE_SET_POSITION_CMD  = 0x12  /**< move to an angle in a given time (profile MCSDK 5.4 only) */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_st_frame_code motorlink_st_frame_code;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_st_frame_code;
#endif

/** Commands (table 4). */
enum motorlink_st_command
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_ST_COMMAND_START_MOTOR   = 0x01, /**< start the motor; nothing happens when it runs or is in fault */
  MOTORLINK_ST_COMMAND_STOP_MOTOR    = 0x02, /**< stop the motor */
  MOTORLINK_ST_COMMAND_STOP_RAMP     = 0x03, /**< stop the ramp that is executing */
  MOTORLINK_ST_COMMAND_RESET         = 0x04, /**< acknowledged without effect (mcsdk-5.4 only) */
  MOTORLINK_ST_COMMAND_PING          = 0x05, /**< acknowledged without effect (mcsdk-5.4 only) */
  MOTORLINK_ST_COMMAND_START_STOP    = 0x06, /**< start an idle motor, stop a spinning one */
  MOTORLINK_ST_COMMAND_FAULT_ACK     = 0x07, /**< acknowledge past faults whose cause is gone */
  MOTORLINK_ST_COMMAND_ENCODER_ALIGN = 0x08, /**< align the encoder */
  MOTORLINK_ST_COMMAND_IQDREF_CLEAR  = 0x09, /**< set the current references to their defaults */
  MOTORLINK_ST_COMMAND_PFC_ENABLE    = 0x0A, /**< start the power factor correction */
  MOTORLINK_ST_COMMAND_PFC_DISABLE   = 0x0B, /**< stop the power factor correction */
  MOTORLINK_ST_COMMAND_PFC_FAULT_ACK = 0x0C, /**< acknowledge past faults of the power factor correction */
  MOTORLINK_ST_COMMAND_SC_START      = 0x0D, /**< start the motor profiler (mcsdk-5.4 only) */
  MOTORLINK_ST_COMMAND_SC_STOP       = 0x0E  /**< stop the motor profiler; acts as STOP_MOTOR (mcsdk-5.4 only) */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_st_command motorlink_st_command;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_st_command;
#endif

/** Why a drive refused (table 2). */
enum motorlink_st_error_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_ST_ERROR_CODE_NONE               = 0x00, /**< not an error; never found in a NACK */
  MOTORLINK_ST_ERROR_CODE_BAD_FRAME_ID       = 0x01, /**< the drive does not know this frame code */
  MOTORLINK_ST_ERROR_CODE_SET_READ_ONLY      = 0x02, /**< the register is read-only or does not exist */
  MOTORLINK_ST_ERROR_CODE_GET_WRITE_ONLY     = 0x03, /**< the register cannot be read or does not exist */
  MOTORLINK_ST_ERROR_CODE_WRONG_SET          = 0x05, /**< the value is not valid */
  MOTORLINK_ST_ERROR_CODE_WRONG_CMD          = 0x07, /**< the command is unknown or not possible on this drive */
  MOTORLINK_ST_ERROR_CODE_OVERRUN            = 0x08, /**< bytes came faster than the drive could take them */
  MOTORLINK_ST_ERROR_CODE_TIMEOUT            = 0x09, /**< the drive did not receive the whole frame in time */
  MOTORLINK_ST_ERROR_CODE_BAD_CRC            = 0x0A, /**< the checksum did not match what the drive received */
  MOTORLINK_ST_ERROR_CODE_BAD_MOTOR_SELECTED = 0x0B, /**< the drive has no motor of this number */
  MOTORLINK_ST_ERROR_CODE_MP_NOT_ENABLED     = 0x0C  /**< the drive is built without the motor profiler */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_st_error_code motorlink_st_error_code;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_st_error_code;
#endif

/** Values of register STATUS. */
enum motorlink_st_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_ST_STATUS_IDLE                  = 0x00, /**< at rest, ready to start */
  MOTORLINK_ST_STATUS_IDLE_ALIGNMENT        = 0x01, /**< about to align the encoder */
  MOTORLINK_ST_STATUS_ALIGNMENT             = 0x02, /**< aligning the encoder */
  MOTORLINK_ST_STATUS_IDLE_START            = 0x03, /**< about to start */
  MOTORLINK_ST_STATUS_START                 = 0x04, /**< rev-up */
  MOTORLINK_ST_STATUS_START_RUN             = 0x05, /**< rev-up is over, about to run */
  MOTORLINK_ST_STATUS_RUN                   = 0x06, /**< under closed-loop control */
  MOTORLINK_ST_STATUS_ANY_STOP              = 0x07, /**< a stop was asked for */
  MOTORLINK_ST_STATUS_STOP                  = 0x08, /**< stopping */
  MOTORLINK_ST_STATUS_STOP_IDLE             = 0x09, /**< stopped, about to be idle */
  MOTORLINK_ST_STATUS_FAULT_NOW             = 0x0A, /**< the cause of a fault is present */
  MOTORLINK_ST_STATUS_FAULT_OVER            = 0x0B, /**< a fault occurred; no cause is present, and the drive waits for FAULT_ACK */
  MOTORLINK_ST_STATUS_ICLWAIT               = 0x0C, /**< waiting for the inrush current limiter */
  MOTORLINK_ST_STATUS_ALIGN_CHARGE_BOOT_CAP = 0x0D, /**< charging boot capacitors before alignment */
  MOTORLINK_ST_STATUS_ALIGN_OFFSET_CALIB    = 0x0E, /**< calibrating current offsets before alignment */
  MOTORLINK_ST_STATUS_ALIGN_CLEAR           = 0x0F, /**< clearing controllers before alignment */
  MOTORLINK_ST_STATUS_CHARGE_BOOT_CAP       = 0x10, /**< charging the boot capacitors */
  MOTORLINK_ST_STATUS_OFFSET_CALIB          = 0x11, /**< calibrating the current offsets */
  MOTORLINK_ST_STATUS_CLEAR                 = 0x12, /**< clearing the controllers */
  MOTORLINK_ST_STATUS_SWITCH_OVER           = 0x13, /**< changing from rev-up to the observer */
  MOTORLINK_ST_STATUS_WAIT_STOP_MOTOR       = 0x14  /**< waiting for the rotor to stand still */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_st_status motorlink_st_status;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_st_status;
#endif

/** Values of register CONTROL_MODE. */
enum motorlink_st_control_mode
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_ST_CONTROL_MODE_TORQUE = 0x00, /**< the Iq reference is commanded */
  MOTORLINK_ST_CONTROL_MODE_SPEED  = 0x01  /**< the speed reference is commanded */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_st_control_mode motorlink_st_control_mode;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_st_control_mode;
#endif

/** Bits of register FLAGS: occurred; 16 bits to the left: present. */
enum motorlink_st_fault {
  MOTORLINK_ST_FAULT_FOC_DURATION = 0x01, /**< the control loop took longer than its period */
  MOTORLINK_ST_FAULT_OVER_VOLT    = 0x02, /**< bus voltage too high */
  MOTORLINK_ST_FAULT_UNDER_VOLT   = 0x04, /**< bus voltage too low */
  MOTORLINK_ST_FAULT_OVER_TEMP    = 0x08, /**< heatsink too hot */
  MOTORLINK_ST_FAULT_START_UP     = 0x10, /**< the motor did not start */
  MOTORLINK_ST_FAULT_SPEED_FDBK   = 0x20, /**< speed feedback lost */
  MOTORLINK_ST_FAULT_BREAK_IN     = 0x40, /**< over-current */
  MOTORLINK_ST_FAULT_SW_ERROR     = 0x80  /**< software error */
};

/** What a motor's control may be built with. */
enum motorlink_st_feature {
  MOTORLINK_ST_FEATURE_OBSERVER_PLL     = 0x0002, /**< state observer with PLL */
  MOTORLINK_ST_FEATURE_OBSERVER_CORDIC  = 0x0004, /**< state observer with CORDIC */
  MOTORLINK_ST_FEATURE_POSITION_SENSOR  = 0x0008, /**< encoder or Hall sensors */
  MOTORLINK_ST_FEATURE_FLUX_WEAKENING   = 0x0010, /**< flux weakening */
  MOTORLINK_ST_FEATURE_FEED_FORWARD     = 0x0020, /**< feed-forward */
  MOTORLINK_ST_FEATURE_PFC              = 0x0040, /**< power factor correction */
  MOTORLINK_ST_FEATURE_DAC              = 0x0080, /**< DAC */
  MOTORLINK_ST_FEATURE_HFI              = 0x0100, /**< high-frequency injection */
  MOTORLINK_ST_FEATURE_PROFILER         = 0x0200, /**< motor profiler */
  MOTORLINK_ST_FEATURE_POSITION_CONTROL = 0x0400  /**< position control */
};

/** Commands (chapter 2): the first byte of request and reply. */
enum motorlink_rmd_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_RMD_CODE_READ_PID                         = 0x30, /**< reads the gains in RAM */
  MOTORLINK_RMD_CODE_WRITE_PID_RAM                    = 0x31, /**< sets the gains until power-off */
  MOTORLINK_RMD_CODE_WRITE_PID_ROM                    = 0x32, /**< sets the gains for good; wears the ROM */
  MOTORLINK_RMD_CODE_READ_ACCELERATION                = 0x33, /**< reads the acceleration limit */
  MOTORLINK_RMD_CODE_WRITE_ACCELERATION_RAM           = 0x34, /**< sets the acceleration limit until power-off */
  MOTORLINK_RMD_CODE_READ_ENCODER                     = 0x90, /**< reads encoder position, original position and offset */
  MOTORLINK_RMD_CODE_WRITE_ENCODER_OFFSET_ROM         = 0x91, /**< sets the encoder offset, at once and for good; wears the ROM */
  MOTORLINK_RMD_CODE_WRITE_ZERO_ROM                   = 0x19, /**< makes the current position the zero effective after the next power cycle; wears the ROM */
  MOTORLINK_RMD_CODE_READ_MULTI_TURN_ANGLE            = 0x92, /**< reads the angle over all turns */
  MOTORLINK_RMD_CODE_READ_SINGLE_TURN_ANGLE           = 0x94, /**< reads the angle within the turn */
  MOTORLINK_RMD_CODE_READ_STATUS                      = 0x9A, /**< reads temperature, voltage and error flags */
  MOTORLINK_RMD_CODE_CLEAR_ERRORS                     = 0x9B, /**< clears the error flags whose cause is gone */
  MOTORLINK_RMD_CODE_READ_MOTION_STATUS               = 0x9C, /**< reads temperature, torque current, speed and encoder position */
  MOTORLINK_RMD_CODE_READ_PHASE_CURRENTS              = 0x9D, /**< reads the three phase currents */
  MOTORLINK_RMD_CODE_OFF                              = 0x80, /**< switches the motor off and forgets what it was doing */
  MOTORLINK_RMD_CODE_STOP                             = 0x81, /**< stops the motor and remembers what it was doing */
  MOTORLINK_RMD_CODE_RUN                              = 0x88, /**< resumes what the motor was doing before the stop */
  MOTORLINK_RMD_CODE_SET_TORQUE                       = 0xA1, /**< holds a torque current */
  MOTORLINK_RMD_CODE_SET_SPEED                        = 0xA2, /**< holds a speed */
  MOTORLINK_RMD_CODE_SET_POSITION                     = 0xA3, /**< turns to a multi-turn angle */
  MOTORLINK_RMD_CODE_SET_POSITION_LIMITED             = 0xA4, /**< turns to a multi-turn angle no faster than a limit */
  MOTORLINK_RMD_CODE_SET_SINGLE_TURN_POSITION         = 0xA5, /**< turns to an angle within the turn, in a given direction */
  MOTORLINK_RMD_CODE_SET_SINGLE_TURN_POSITION_LIMITED = 0xA6  /**< turns to an angle within the turn, in a given direction, no faster than a limit */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_rmd_code motorlink_rmd_code;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_rmd_code;
#endif

/** Bits of the error state. */
enum motorlink_rmd_error {
  MOTORLINK_RMD_ERROR_LOW_VOLTAGE      = 0x01, /**< low voltage protection */
  MOTORLINK_RMD_ERROR_OVER_TEMPERATURE = 0x08  /**< over temperature protection */
};

/** Which way to turn to an angle within the turn. */
enum motorlink_rmd_spin_direction
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
 {
  MOTORLINK_RMD_SPIN_DIRECTION_CLOCKWISE        = 0x00, /**< towards growing angles */
  MOTORLINK_RMD_SPIN_DIRECTION_COUNTERCLOCKWISE = 0x01  /**< towards falling angles */
};
#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum motorlink_rmd_spin_direction motorlink_rmd_spin_direction;
#elif !defined(__cplusplus)
typedef uint8_t motorlink_rmd_spin_direction;
#endif

/** CAN identifiers. */
enum motorlink_rmd_can_id {
  MOTORLINK_RMD_MOTOR_BASE = 0x0140, /**< request and reply of the motor with ID n have the identifier n above this */
  MOTORLINK_RMD_TORQUE4_ID = 0x0280  /**< torque currents for motors 1 to 4 */
};



/**
 * Success, the same as MOTORLINK_ERROR_OK.
 */
#define MOTORLINK_OK 0

/**
 * The moment of a `WAIT` without a deadline: a received byte or frame, or a new request, ends it.
 */
#define MOTORLINK_NEVER UINT64_MAX

/**
 * In limits: no limit.
 */
#define MOTORLINK_NO_LIMIT (-1)

/**
 * Words of 8 bytes in a `motorlink_st_slave`.
 */
#define MOTORLINK_ST_SLAVE_WORDS 38

/**
 * Words of 8 bytes in a `motorlink_st_master`.
 */
#define MOTORLINK_ST_MASTER_WORDS 37

/**
 * Words of 8 bytes in a `motorlink_rmd_host`.
 */
#define MOTORLINK_RMD_HOST_WORDS 335

/**
 * Words of 8 bytes in a `motorlink_rmd_drive`.
 */
#define MOTORLINK_RMD_DRIVE_WORDS 13

/**
 * Words of 8 bytes in a `motorlink_slcan_host`.
 */
#define MOTORLINK_SLCAN_HOST_WORDS 7

/**
 * Words of 8 bytes in a `motorlink_slcan_device`.
 */
#define MOTORLINK_SLCAN_DEVICE_WORDS 7

/**
 * Bytes for a text of a reply, with its NUL.
 */
#define MOTORLINK_ST_TEXT_SIZE 33

/**
 * The longest payload.
 */
#define MOTORLINK_ST_MAX_PAYLOAD 128

/**
 * The `id` if a call returns no frame.
 */
#define MOTORLINK_NO_FRAME UINT32_MAX

/**
 * The longest line: a frame of 8 bytes with 29 bits of identifier and a timestamp.
 */
#define MOTORLINK_SLCAN_LINE_SIZE 31

/**
 * The result of a call, or of an exchange. 0 is success.
 */
enum motorlink_error
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Done.
   */
  MOTORLINK_ERROR_OK = 0,
  /**
   * A required pointer is NULL.
   */
  MOTORLINK_ERROR_NULL_POINTER = 1,
  /**
   * A pointer is not aligned for its type.
   */
  MOTORLINK_ERROR_MISALIGNED = 2,
  /**
   * The storage is smaller than this library needs: header and library are of different versions.
   */
  MOTORLINK_ERROR_STORAGE_TOO_SMALL = 3,
  /**
   * The storage was never initialised, or was overwritten.
   */
  MOTORLINK_ERROR_UNINITIALISED = 4,
  /**
   * The storage belongs to an object of another kind.
   */
  MOTORLINK_ERROR_WRONG_KIND = 5,
  /**
   * A call for this object is under way: this one comes from one of its callbacks, from an
   * interrupt or from another thread.
   */
  MOTORLINK_ERROR_IN_USE = 6,
  /**
   * A number is outside of its range.
   */
  MOTORLINK_ERROR_BAD_ARGUMENT = 7,
  /**
   * The payload does not fit a frame.
   */
  MOTORLINK_ERROR_TOO_LONG = 8,
  /**
   * An exchange is under way, with the drive (ST) or this motor (RMD).
   */
  MOTORLINK_ERROR_BUSY = 9,
  /**
   * The drive refused; `error_code` tells why (ST).
   */
  MOTORLINK_ERROR_REFUSED = 20,
  /**
   * No reply in time. It is not known whether the drive executed the request.
   */
  MOTORLINK_ERROR_TIMEOUT = 21,
  /**
   * A reply began and stopped (ST).
   */
  MOTORLINK_ERROR_INCOMPLETE = 22,
  /**
   * A received byte does not begin a reply (ST).
   */
  MOTORLINK_ERROR_NOT_A_REPLY = 23,
  /**
   * A reply is damaged (ST).
   */
  MOTORLINK_ERROR_DAMAGED = 24,
  /**
   * The drive did not understand what it received; `error_code` tells why (ST).
   */
  MOTORLINK_ERROR_NOT_UNDERSTOOD = 25,
  /**
   * Two different replies arrived at once (ST).
   */
  MOTORLINK_ERROR_AMBIGUOUS = 26,
  /**
   * The line was out of sync before, and the drive does not answer a test question. The request was
   * not sent (ST).
   */
  MOTORLINK_ERROR_LOST = 27,
  /**
   * The line was out of sync before, and bytes keep arriving. Nothing was sent (ST).
   */
  MOTORLINK_ERROR_NOISE = 28,
  /**
   * The drive acknowledged, but the reply does not contain a value of the register (ST).
   */
  MOTORLINK_ERROR_WRONG_REPLY = 29,
  /**
   * The value of a register is possible in the other profile only: the profile may be wrong (ST).
   */
  MOTORLINK_ERROR_IMPLAUSIBLE = 30,
  /**
   * A late reply of this motor may still come: the last request had no reply, or this is the first
   * request to the motor. Only a read was sent, unless the request was Off or Stop. Ask again (RMD).
   */
  MOTORLINK_ERROR_QUARANTINED = 40,
  /**
   * A limit that the caller set, or the document's range, is exceeded; nothing was sent.
   */
  MOTORLINK_ERROR_LIMIT = 41,
  /**
   * The reply is of another protocol: RMD V3 or V4, or LK-Tech V2.36 (RMD).
   */
  MOTORLINK_ERROR_FOREIGN = 42,
  /**
   * The reply should repeat the request and differs from it. It is not known what the motor did
   * (RMD).
   */
  MOTORLINK_ERROR_ALTERED = 43,
  /**
   * The frame that was sent was received: an adapter or the wiring echoes, or another host sends the
   * same. Only a read was sent to a drive (ST). It is not known what the motor did (RMD).
   */
  MOTORLINK_ERROR_ECHO = 44,
  /**
   * Replies since the last confirmation may belong to other requests: a reply came twice or late, or
   * the confirmation failed.
   */
  MOTORLINK_ERROR_UNCONFIRMED = 45,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum motorlink_error motorlink_error;
#else
typedef int32_t motorlink_error;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What the caller of a `poll` has to do next.
 */
enum motorlink_output
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Hand in what arrives, and poll again at `until_us` at the latest.
   */
  MOTORLINK_OUTPUT_WAIT = 0,
  /**
   * Send, then poll again.
   */
  MOTORLINK_OUTPUT_TRANSMIT = 1,
  /**
   * An exchange is over; poll again.
   */
  MOTORLINK_OUTPUT_DONE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum motorlink_output motorlink_output;
#else
typedef uint8_t motorlink_output;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What a motor does.
 */
enum motorlink_rmd_mode
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * No current.
   */
  MOTORLINK_RMD_MODE_OFF = 0,
  /**
   * Brakes to a standstill and stays there.
   */
  MOTORLINK_RMD_MODE_STOPPED = 1,
  /**
   * Holds `iq_16ma`.
   */
  MOTORLINK_RMD_MODE_TORQUE = 2,
  /**
   * Holds `speed_centidps`.
   */
  MOTORLINK_RMD_MODE_SPEED = 3,
  /**
   * Turns to `target_counts` and holds it.
   */
  MOTORLINK_RMD_MODE_POSITION = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum motorlink_rmd_mode motorlink_rmd_mode;
#else
typedef uint8_t motorlink_rmd_mode;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * What an adapter has sent.
 */
enum motorlink_slcan_answer
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Nothing yet.
   */
  MOTORLINK_SLCAN_ANSWER_NONE = 0,
  /**
   * A frame came from the bus.
   */
  MOTORLINK_SLCAN_ANSWER_FRAME = 1,
  /**
   * A command or a frame was taken.
   */
  MOTORLINK_SLCAN_ANSWER_TAKEN = 2,
  /**
   * A command or a frame was refused.
   */
  MOTORLINK_SLCAN_ANSWER_REFUSED = 3,
  /**
   * The answer to a question about version, serial number or status.
   */
  MOTORLINK_SLCAN_ANSWER_INFO = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum motorlink_slcan_answer motorlink_slcan_answer;
#else
typedef uint8_t motorlink_slcan_answer;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The answer to a board information request (4.7).
 */
typedef struct motorlink_st_board_info {
  /**
   * Major version of the SDK.
   */
  uint8_t major;
  /**
   * Minor version of the SDK.
   */
  uint8_t minor;
  /**
   * Patch version of the SDK.
   */
  uint8_t patch;
  /**
   * Name of the SDK, UTF-8, with a NUL at its end.
   */
  char name[MOTORLINK_ST_TEXT_SIZE];
} motorlink_st_board_info;

/**
 * The answer to a firmware version request (4.12).
 */
typedef struct motorlink_st_firmware_version {
  /**
   * Name of the firmware, UTF-8, with a NUL at its end.
   */
  char name[MOTORLINK_ST_TEXT_SIZE];
  /**
   * Its version, such as `Ver.5.4.4`, UTF-8, with a NUL at its end.
   */
  char version[MOTORLINK_ST_TEXT_SIZE];
} motorlink_st_firmware_version;

/**
 * A phase of the rev-up (4.9).
 */
typedef struct motorlink_st_revup_phase {
  /**
   * Mechanical speed at the end of the phase, rpm.
   */
  int32_t speed_rpm;
  /**
   * Iq at the end of the phase, s16A digits.
   */
  int16_t torque_s16a;
  /**
   * Length of the phase, ms.
   */
  uint16_t duration_ms;
} motorlink_st_revup_phase;

/**
 * How a master behaves. Begin with `motorlink_st_master_defaults()`, then change fields. A field that is 0
 * has its default.
 */
typedef struct motorlink_st_master_config {
  /**
   * How long to wait for a reply, µs. 0: 1 s, as in the document.
   */
  uint32_t timeout_us;
  /**
   * The line counts as silent after this time without a byte, µs. 0: 50 ms.
   */
  uint32_t quiet_us;
  /**
   * The line's baud rate, for ports that take bytes faster than the line sends them, as ports of computers
   * do. The silence of a recovery then begins when its bytes have left the port. 0: not known.
   */
  uint32_t baud;
  /**
   * How the drive behaves.
   */
  motorlink_st_profile profile;
  /**
   * How the master recovers a line that is out of sync.
   */
  motorlink_st_recovery recovery;
} motorlink_st_master_config;

/**
 * A master of ST's Motor Control Protocol, in storage of the caller: static, on the stack or on the heap.
 * Opaque. It may be moved and copied while no call for it is under way.
 */
typedef struct motorlink_st_master {
  /**
   * Private; do not access.
   */
  uint64_t opaque[MOTORLINK_ST_MASTER_WORDS];
} motorlink_st_master;

/**
 * Limits of requests. They hold for every function.
 *
 * While `speed_rpm` is set, a motor is started only after a speed ramp to it was acknowledged: else the
 * drive goes to a speed of its own. The ramp may be `motorlink_st_master_set_ramp` or a write of
 * RAMP_FINAL_SPEED. It no longer counts after a later ramp that was not acknowledged, after a torque
 * command, a write of CONTROL_MODE or a RESET, and after the drive identified itself anew or the line
 * was lost or opened again. Position commands carry no speed and are refused.
 *
 * A limit bounds requests. `speed_rpm` does not bound a torque command (the motor turns as fast
 * as its load allows), speeds of the drive's own (rev-up, alignment, motor profiler), what its
 * regulator overshoots, a motor that was running before, nor a start after the drive was reset without
 * a sign on the line.
 */
typedef struct motorlink_st_limits {
  /**
   * Highest speed in either direction, rpm, or `MOTORLINK_NO_LIMIT`.
   */
  int32_t speed_rpm;
  /**
   * Highest reference of Iq or Id in either direction, s16A digits, or `MOTORLINK_NO_LIMIT`.
   */
  int32_t current_s16a;
} motorlink_st_limits;

/**
 * Bytes in the storage of an object: send or copy them before the next call for it.
 */
typedef struct motorlink_bytes {
  /**
   * The first byte. Never NULL, even if `size` is 0.
   */
  const uint8_t *data;
  /**
   * How many bytes there are.
   */
  size_t size;
} motorlink_bytes;

/**
 * What to do next, or the result of the exchange.
 */
typedef struct motorlink_st_output {
  /**
   * `WAIT`: the latest moment for the next poll, `MOTORLINK_NEVER` outside of an exchange.
   */
  uint64_t until_us;
  /**
   * `TRANSMIT`: what to send. `DONE`: the payload of the reply. They belong to the master, until
   * the next call for it.
   */
  struct motorlink_bytes bytes;
  /**
   * `DONE`: whether the drive executed the request, or why not.
   */
  motorlink_error result;
  /**
   * `DONE` of a register read: the register's value, the sign extended as its type has it; the
   * bits of a floating-point register; of a register of type u32 the cast to `uint32_t` is the
   * value. `motorlink_st_check_value` checks the profile. 0 for anything else.
   */
  int32_t value;
  /**
   * What this is: `WAIT`, `TRANSMIT` or `DONE`.
   */
  motorlink_output kind;
  /**
   * `DONE` with `REFUSED` or `NOT_UNDERSTOOD`: why, which may be a number that the document does
   * not name.
   */
  motorlink_st_error_code error_code;
} motorlink_st_output;

/**
 * A slave of ST's Motor Control Protocol, in storage of the caller: static, on the stack or on the heap.
 * Opaque. It may be moved and copied while no call for it is under way.
 */
typedef struct motorlink_st_slave {
  /**
   * Private; do not access.
   */
  uint64_t opaque[MOTORLINK_ST_SLAVE_WORDS];
} motorlink_st_slave;

/**
 * The firmware's version, as board information (4.7) and firmware version (4.12) tell it.
 */
typedef struct motorlink_st_version {
  /**
   * Name of the SDK, ASCII, NUL-terminated; the replies have room for 28 and 15 bytes of it.
   * NULL: no name.
   */
  const char *name;
  /**
   * Type and number of a pre-release, such as "RC2", ASCII, NUL-terminated. NULL: a release.
   */
  const char *pre_release;
  /**
   * Major version.
   */
  uint8_t major;
  /**
   * Minor version.
   */
  uint8_t minor;
  /**
   * Patch version.
   */
  uint8_t patch;
} motorlink_st_version;

/**
 * The drive behind a slave. The slave has checked the frame, the motor, the register's existence and
 * access, and every size before it calls.
 *
 * `execute` is required. Every other callback may be NULL. Callbacks are called from within
 * `motorlink_st_slave_receive`, and may not call for the same slave: such calls give `IN_USE`. `motor`
 * is 1 to 7, and exists.
 *
 * `motorlink conformance st` checks such a drive. What it asks of a callback beyond the document is
 * a reading: a row of SPEC-NOTES.md, named in brackets. A drive that differs from readings
 * passes, and fails with `--readings strict`.
 */
typedef struct motorlink_st_motor_control {
  /**
   * Handed to each callback.
   */
  void *context;
  /**
   * The firmware's version.
   */
  struct motorlink_st_version version;
  /**
   * What this motor's control is built with: a sum of `MOTORLINK_ST_FEATURE_*`.
   * NULL: nothing.
   */
  uint16_t (*features)(void *context, uint8_t motor);
  /**
   * The value of a register that exists with `features`. Not called for TARGET_MOTOR, which
   * the slave keeps. FLUXWK_BUS and FLUXWK_BUS_MEAS have 0.1 % a digit here and in
   * `set_register`, in both profiles; the slave converts. The value of a floating-point register is
   * its bits. NULL: 0.
   *
   * STATUS is IDLE at rest and RUN once the motor runs, FAULT_NOW and FAULT_OVER in fault; FLAGS
   * has the faults that occurred in the low half and those present in the high half (S14).
   * CONTROL_MODE reads what was asked for last, at once: speed after a ramp, torque after
   * current references (S15, S25). At rest TORQUE_REF and FLUX_REF read what was asked for last
   * and SPEED_REF is 0; in RUN SPEED_REF follows the ramp (S48). In speed mode FLUX_REF reads what
   * was written to IQ_SPEEDMODE (S22). RAMP_FINAL_SPEED is the end of the last ramp (S26).
   * PFC_ENABLED is 0 or 1 (S50). Temperatures and power may be below 0 (S23).
   */
  int32_t (*get_register)(void *context, uint8_t motor, motorlink_st_reg reg);
  /**
   * Writes a register that may be written; gives `MOTORLINK_ST_ERROR_CODE_NONE`, or why not:
   * WRONG_SET for a value that the register cannot take. NULL: WRONG_SET.
   *
   * Not called for TARGET_MOTOR, nor for a DAC channel with a register that it cannot show. Every
   * value of the register's type is taken and read back, 70002 rpm too (S49): limit what the motor
   * does, not what is kept. CONTROL_MODE from 2 on gives 0 and changes nothing (S15). IQ_SPEEDMODE
   * is the Id reference of speed mode (S22), so that FLUX_REF reads it. RAMP_FINAL_SPEED begins a
   * ramp of the last duration (S26). At rest nothing that is written starts the motor.
   */
  motorlink_st_error_code (*set_register)(void *context,
                                          uint8_t motor,
                                          motorlink_st_reg reg,
                                          int32_t value);
  /**
   * Executes a command. What the state does not allow has no effect (4.6). Required: the slave
   * acknowledges the command, and a master relies on an acknowledged STOP_MOTOR.
   *
   * In fault START_MOTOR and START_STOP do nothing. While a fault is present FAULT_ACK changes
   * neither STATUS nor FLAGS. STOP_RAMP leaves the motor at the speed it has. IQDREF_CLEAR brings
   * TORQUE_REF, FLUX_REF and what IQ_SPEEDMODE was written back to their defaults. ENCODER_ALIGN
   * does nothing in RUN, and STATUS is IDLE when it is over (S53). Commands of a PFC come with
   * `MOTORLINK_ST_FEATURE_PFC` only.
   */
  void (*execute)(void *context, uint8_t motor, motorlink_st_command command);
  /**
   * Programs a speed ramp: at once in RUN, else when RUN is reached (4.8). 0 ms is a step.
   * NULL: acknowledged, without effect.
   */
  void (*set_ramp)(void *context, uint8_t motor, int32_t speed_rpm, uint16_t duration_ms);
  /**
   * Gives rev-up phase 0 to 4 (4.9); what is not set is 0. NULL: all is 0.
   */
  void (*get_revup_data)(void *context,
                         uint8_t motor,
                         uint8_t phase,
                         struct motorlink_st_revup_phase *data);
  /**
   * Sets rev-up phase 0 to 4 (4.10). NULL: acknowledged, without effect.
   */
  void (*set_revup_data)(void *context,
                         uint8_t motor,
                         uint8_t phase,
                         const struct motorlink_st_revup_phase *data);
  /**
   * Sets the current references: at once in RUN, else when RUN is reached (4.11).
   * NULL: acknowledged, without effect.
   */
  void (*set_current_reference)(void *context, uint8_t motor, int16_t iq_s16a, int16_t id_s16a);
  /**
   * Programs a torque ramp (profile MCSDK 5.4). NULL: acknowledged, without effect.
   */
  void (*set_torque_ramp)(void *context, uint8_t motor, int32_t torque_s16a, uint16_t duration_ms);
  /**
   * Moves to an angle (profile MCSDK 5.4, with POSITION_CONTROL). NULL: acknowledged, without effect.
   */
  void (*set_position)(void *context, uint8_t motor, float angle_rad, float duration_s);
  /**
   * Registers that a step of the motor profiler shows (profile MCSDK 5.4, with PROFILER): gives
   * how many there are and where, until the next call of a callback. NULL: none.
   */
  uint8_t (*profiler_step)(void *context,
                           uint8_t motor,
                           uint8_t step,
                           const motorlink_st_reg **registers);
} motorlink_st_motor_control;

/**
 * The eight bytes of a request or a reply.
 */
typedef struct motorlink_rmd_data {
  /**
   * DATA\[0\] to DATA\[7\].
   */
  uint8_t bytes[8];
} motorlink_rmd_data;

/**
 * Values of the reply to 0x30, 0x31, 0x32.
 */
typedef struct motorlink_rmd_pid {
  /**
   * Kp of the position loop (`anglePidKp`), no unit.
   */
  uint8_t position_kp;
  /**
   * Ki of the position loop (`anglePidKi`), no unit.
   */
  uint8_t position_ki;
  /**
   * Kp of the speed loop (`speedPidKp`), no unit.
   */
  uint8_t speed_kp;
  /**
   * Ki of the speed loop (`speedPidKi`), no unit.
   */
  uint8_t speed_ki;
  /**
   * Kp of the current loop (`iqPidKp`), no unit.
   */
  uint8_t torque_kp;
  /**
   * Ki of the current loop (`iqPidKi`), no unit.
   */
  uint8_t torque_ki;
} motorlink_rmd_pid;

/**
 * Values of the reply to 0x90.
 */
typedef struct motorlink_rmd_encoder {
  /**
   * `raw` minus `offset`, modulo one turn.
   */
  uint16_t position;
  /**
   * The original position.
   */
  uint16_t raw;
  /**
   * The zero point.
   */
  uint16_t offset;
} motorlink_rmd_encoder;

/**
 * Values of the reply to 0x9A, 0x9B.
 */
typedef struct motorlink_rmd_status {
  /**
   * 0.1 V a digit.
   */
  uint16_t voltage_decivolts;
  /**
   * 1 °C a digit.
   */
  int8_t temperature_celsius;
  /**
   * Which protections are active, a bit each (`MOTORLINK_RMD_ERROR_*`).
   */
  uint8_t errors;
} motorlink_rmd_status;

/**
 * Values of the reply to 0x9C, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6.
 */
typedef struct motorlink_rmd_motion_status {
  /**
   * Torque current, 33/2048 A a digit.
   */
  int16_t iq_digits;
  /**
   * 1 °/s a digit, positive is clockwise.
   */
  int16_t speed_dps;
  /**
   * Encoder position in counts of its width, the upper 16 bits of a wider one.
   */
  uint16_t encoder;
  /**
   * 1 °C a digit.
   */
  int8_t temperature_celsius;
} motorlink_rmd_motion_status;

/**
 * Values of the reply to 0x9D.
 */
typedef struct motorlink_rmd_phase_currents {
  /**
   * Phase A, 1/64 A a digit.
   */
  int16_t phase_a_digits;
  /**
   * Phase B, 1/64 A a digit.
   */
  int16_t phase_b_digits;
  /**
   * Phase C, 1/64 A a digit.
   */
  int16_t phase_c_digits;
} motorlink_rmd_phase_currents;

/**
 * The host of a bus with RMD motors, in storage of the caller: static, on the stack or on the heap.
 * Opaque. It may be moved and copied while no call for it is under way.
 */
typedef struct motorlink_rmd_host {
  /**
   * Private; do not access.
   */
  uint64_t opaque[MOTORLINK_RMD_HOST_WORDS];
} motorlink_rmd_host;

/**
 * Limits of requests to a motor, in addition to the document's ranges. Each holds in both directions.
 */
typedef struct motorlink_rmd_limits {
  /**
   * Greatest torque current of 0xA1 and 0x280, 0.016 A a digit, or `MOTORLINK_NO_LIMIT`.
   */
  int32_t current_16ma;
  /**
   * Greatest speed of 0xA2, 0xA4 and 0xA6, °/s, or `MOTORLINK_NO_LIMIT`. 0xA3 and 0xA5
   * carry no speed and are refused while this is set, as are 0xA4 and 0xA6 with 0. It does not
   * limit torque commands: the motor turns as fast as its load allows.
   */
  int32_t speed_dps;
  /**
   * Greatest distance from zero in 0xA3 and 0xA4, 0.01° a digit, or `MOTORLINK_NO_LIMIT`.
   */
  int32_t angle_centidegrees;
} motorlink_rmd_limits;

/**
 * A classic CAN frame of any kind.
 */
typedef struct motorlink_can_frame {
  /**
   * The identifier: 11 bits, or 29.
   */
  uint32_t id;
  /**
   * 1 if the identifier has 29 bits.
   */
  uint8_t extended;
  /**
   * 1 for a remote transmission request.
   */
  uint8_t remote;
  /**
   * The length code, 0 to 8.
   */
  uint8_t size;
  /**
   * The bytes, of which the first `size` are used.
   */
  uint8_t data[8];
} motorlink_can_frame;

/**
 * What to do next, or the result of an exchange.
 */
typedef struct motorlink_rmd_output {
  /**
   * `WAIT`: the latest moment for the next poll, `MOTORLINK_NEVER` outside of an exchange.
   */
  uint64_t until_us;
  /**
   * `TRANSMIT`: the frame to send.
   */
  struct motorlink_can_frame frame;
  /**
   * `DONE`: the motor's reply, for the `motorlink_rmd_decode_*` functions.
   */
  struct motorlink_rmd_data reply;
  /**
   * `DONE`: the result of the exchange.
   */
  motorlink_error result;
  /**
   * What this is: `WAIT`, `TRANSMIT` or `DONE`.
   */
  motorlink_output kind;
  /**
   * `DONE`: the motor, 1 to 32.
   */
  uint8_t motor;
} motorlink_rmd_output;

/**
 * An RMD drive, in storage of the caller: static, on the stack or on the heap.
 * Opaque. It may be moved and copied while no call for it is under way.
 */
typedef struct motorlink_rmd_drive {
  /**
   * Private; do not access.
   */
  uint64_t opaque[MOTORLINK_RMD_DRIVE_WORDS];
} motorlink_rmd_drive;

/**
 * Settings of the vendor's tool or of a switch, which no command changes.
 */
typedef struct motorlink_rmd_drive_config {
  /**
   * Switches the motor off after this long without a command, µs; 0 is never.
   */
  uint64_t shutdown_us;
  /**
   * The ID that the drive answers to, 1 to 32.
   */
  uint8_t id;
  /**
   * Width of the encoder, 12 to 18 bits; 0 is the document's 14.
   */
  uint8_t encoder_bits;
  /**
   * The code of the reply to 0x9B: 1 for 0x9B, as in related protocols, 0 for 0x9A, as in the document
   * (SPEC-NOTES.md R1).
   */
  uint8_t clear_reply_0x9b;
} motorlink_rmd_drive_config;

/**
 * What a host can set. Commands use the copy in RAM; power-on copies ROM to RAM.
 */
typedef struct motorlink_rmd_settings {
  /**
   * Acceleration limit, °/s²; 0 or less: not limited.
   */
  int32_t acceleration_dps2;
  /**
   * Encoder value of the zero position, as in frames: at most 16 bits.
   */
  uint16_t encoder_offset;
  /**
   * Gains of the three loops.
   */
  struct motorlink_rmd_pid pid;
} motorlink_rmd_settings;

/**
 * What a motor does. Values that its kind does not use are 0.
 */
typedef struct motorlink_rmd_motion {
  /**
   * `POSITION`: encoder counts as in `motorlink_rmd_sense`.
   */
  int64_t target_counts;
  /**
   * `SPEED`: 0.01 °/s a digit, positive is clockwise.
   */
  int32_t speed_centidps;
  /**
   * `POSITION`: highest speed of the move, °/s; -1: the drive's own.
   */
  int32_t max_speed_dps;
  /**
   * `TORQUE`: torque current, 0.016 A a digit, -2000 to 2000.
   */
  int16_t iq_16ma;
  /**
   * `POSITION`: 1 if the drive's greatest angle limits the move, 0 for moves within the turn.
   */
  uint8_t within_max_angle;
  /**
   * Which kind it is.
   */
  motorlink_rmd_mode kind;
} motorlink_rmd_motion;

/**
 * What the sensors read.
 */
typedef struct motorlink_rmd_sense {
  /**
   * Encoder counts, in the encoder's own resolution. They grow clockwise and continue beyond a
   * turn. Within a turn at power-on.
   */
  int64_t encoder_counts;
  /**
   * Torque current, 33/2048 A a digit.
   */
  int16_t iq_digits;
  /**
   * Speed, °/s, positive is clockwise.
   */
  int16_t speed_dps;
  /**
   * Supply voltage, 0.1 V a digit.
   */
  uint16_t voltage_decivolts;
  /**
   * Currents of the phases A, B and C, 1/64 A a digit.
   */
  int16_t phase_digits[3];
  /**
   * Motor temperature, °C.
   */
  int8_t temperature_celsius;
  /**
   * Faults that are present now, a sum of `MOTORLINK_RMD_ERROR_*`; the drive latches them.
   */
  uint8_t faults;
} motorlink_rmd_sense;

/**
 * The motor behind a drive: the power stage, its control loops and its sensors.
 *
 * `set_mode` is required. Every other callback may be NULL. Callbacks are called from within
 * `motorlink_rmd_drive_power_on`, `_receive` and `_poll`, and may not call for the same drive: such calls
 * give `IN_USE`.
 *
 * `motorlink conformance rmd` checks such a drive. What it asks of a callback beyond the document is
 * a reading: a row of SPEC-NOTES.md, named in brackets. A drive that differs from readings
 * passes, and fails with `--readings strict`.
 */
typedef struct motorlink_rmd_motor_control {
  /**
   * Handed to each callback.
   */
  void *context;
  /**
   * Does this from now on. Required: the drive acknowledges Off and Stop, and a host relies on that.
   *
   * Positive speed and torque turn clockwise, to larger counts (R36). A move is as fast as
   * `max_speed_dps` lets it be, and does not turn with 0 (R13, R40).
   */
  void (*set_mode)(void *context, const struct motorlink_rmd_motion *motion);
  /**
   * Uses these gains and this acceleration limit from now on. NULL: acknowledged, without effect.
   *
   * The limit holds for all motion commands but torque (R39); 0 or less means no limit (R24). Without
   * position gains the motor does not go to a position (R41).
   */
  void (*configure)(void *context, const struct motorlink_rmd_settings *settings);
  /**
   * Reads the sensors. Values that are not set are 0. NULL: all values are 0.
   *
   * Phase currents sum to 0 and have about the size of the torque current (R38). Within 5 ms of a
   * torque command the torque current is as commanded.
   */
  void (*sense)(void *context, struct motorlink_rmd_sense *sense);
  /**
   * Keeps what `motorlink_rmd_drive_init` gets after a power cycle. Wears a real ROM.
   * NULL: forgotten at power-off.
   */
  void (*save)(void *context, const struct motorlink_rmd_settings *rom);
} motorlink_rmd_motor_control;

/**
 * The host's end of a serial line to a CAN adapter, in storage of the caller.
 */
typedef struct motorlink_slcan_host {
  /**
   * Private; do not access.
   */
  uint64_t opaque[MOTORLINK_SLCAN_HOST_WORDS];
} motorlink_slcan_host;

/**
 * Characters to send on the serial line.
 */
typedef struct motorlink_slcan_line {
  /**
   * The characters, of which the first `size` are used.
   */
  uint8_t bytes[MOTORLINK_SLCAN_LINE_SIZE];
  /**
   * The number of characters; 0: nothing to send.
   */
  uint8_t size;
} motorlink_slcan_line;

/**
 * The adapter's end of a serial line to a CAN adapter, in storage of the caller.
 */
typedef struct motorlink_slcan_device {
  /**
   * Private; do not access.
   */
  uint64_t opaque[MOTORLINK_SLCAN_DEVICE_WORDS];
} motorlink_slcan_device;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * The version of the library that is linked, such as "0.1.0": NUL-terminated, constant. A header of
 * another version has another `MOTORLINK_VERSION`.
 */
const char *motorlink_version(void);

/**
 * A sentence for an error, in English, without a full stop. Never NULL, for any number. The text is
 * constant. A program that does not call this function does not contain the texts.
 */
const char *motorlink_error_text(int32_t error);

/**
 * Reads the payload of an answer to `motorlink_st_master_get_board_info`.
 *
 * `BAD_ARGUMENT`: the payload is too short to be one.
 */
motorlink_error motorlink_st_decode_board_info(const uint8_t *payload,
                                               size_t size,
                                               struct motorlink_st_board_info *info);

/**
 * Reads the payload of an answer to `motorlink_st_master_get_firmware_version`. Texts that are not
 * UTF-8 are cut there.
 */
motorlink_error motorlink_st_decode_firmware_version(const uint8_t *payload,
                                                     size_t size,
                                                     struct motorlink_st_firmware_version *version);

/**
 * Reads the payload of an answer to `motorlink_st_master_get_revup_data`.
 *
 * `BAD_ARGUMENT`: the payload is too short to be one.
 */
motorlink_error motorlink_st_decode_revup_data(const uint8_t *payload,
                                               size_t size,
                                               struct motorlink_st_revup_phase *phase);

/**
 * Checks whether `profile` may be right for a register's value that was read, from
 * `motorlink_st_output` or from `motorlink_st_decode_segment`. Call it for values that you show or
 * compute with: without it a wrong profile gives wrong values.
 *
 * `IMPLAUSIBLE`: the value is possible in the other profile only. For example, HEATS_TEMP of -10 °C in
 * MCSDK54 is 65526 °C in SPEC. `BAD_ARGUMENT`: `profile` is not one of its enum's.
 */
motorlink_error motorlink_st_check_value(motorlink_st_profile profile,
                                         motorlink_st_reg reg,
                                         int32_t value);

/**
 * Reads the payload of an answer to `motorlink_st_master_get_segment`: the values of the `count`
 * registers that the segment was configured with, in the same order, into as many `values`, each
 * as in `motorlink_st_output`. The payload has no register numbers: other registers of the same sizes, or
 * another order, are not detected.
 *
 * `BAD_ARGUMENT`: the payload has not the size of these registers; `values` are unchanged.
 */
motorlink_error motorlink_st_decode_segment(const uint8_t *payload,
                                            size_t size,
                                            const motorlink_st_reg *registers,
                                            size_t count,
                                            int32_t *values);

/**
 * The defaults: profile SPEC, the document's timeout of 1 s, DRAIN, 50 ms of silence, no baud rate.
 */
struct motorlink_st_master_config motorlink_st_master_defaults(void);

/**
 * Begins a master on a line that was just opened, whatever the storage held before. Replies to an
 * earlier master may still come. With recovery DRAIN or PAD, the master therefore waits for silence, asks
 * three questions and waits again before the first request. `motorlink_st_master_trust_line` skips that.
 *
 * `size` is `sizeof *master`. `config` is copied; NULL: the defaults.
 *
 * `BAD_ARGUMENT`: `profile` or `recovery` is not one of its enum's.
 */
motorlink_error motorlink_st_master_init(struct motorlink_st_master *master,
                                         size_t size,
                                         const struct motorlink_st_master_config *config);

/**
 * Sets the limits. Effective from the next request. Ramps that were acknowledged before no longer allow
 * a start.
 *
 * `BAD_ARGUMENT`: a limit is neither `MOTORLINK_NO_LIMIT` nor 0 and more, of currents 0 to 65535.
 */
motorlink_error motorlink_st_master_set_limits(struct motorlink_st_master *master,
                                               const struct motorlink_st_limits *limits);

/**
 * Gives what to do next. Poll again after each `TRANSMIT` (when the bytes are with the port) and each
 * `DONE`; after `WAIT` when bytes have arrived or the time is over.
 */
motorlink_error motorlink_st_master_poll(struct motorlink_st_master *master,
                                         uint64_t now_us,
                                         struct motorlink_st_output *output);

/**
 * Takes bytes that came from the drive at `now_us`, in any pieces. `bytes` must not be in the storage.
 *
 * Only `motorlink_st_master_poll` ends an exchange with TIMEOUT. If no poll came after the deadline, a reply
 * that is handed in now ends the exchange, because it may have waited in a buffer. Poll first if a reply
 * after the deadline must not count.
 */
motorlink_error motorlink_st_master_receive(struct motorlink_st_master *master,
                                            uint64_t now_us,
                                            const uint8_t *bytes,
                                            size_t size);

/**
 * Cancels the exchange under way. Its reply may still come, so the line is out of sync.
 */
motorlink_error motorlink_st_master_abandon(struct motorlink_st_master *master);

/**
 * Marks the line as out of sync: something else has sent or received on it. An exchange under way ends
 * without a result.
 */
motorlink_error motorlink_st_master_lost(struct motorlink_st_master *master);

/**
 * Call it after the line was opened again. Late replies may still come, as after
 * `motorlink_st_master_init`; with recovery NONE the caller guarantees that none come. An exchange under
 * way ends without a result.
 */
motorlink_error motorlink_st_master_reopened(struct motorlink_st_master *master);

/**
 * Marks the line as in sync: no late reply can come, because nothing was asked on it. An exchange under
 * way ends without a result.
 */
motorlink_error motorlink_st_master_trust_line(struct motorlink_st_master *master);

/**
 * Sets `lost` to 1 if the line is out of sync: it was just opened, or an exchange failed. The next
 * request then recovers it first. Sets `lost` to 0 otherwise.
 */
motorlink_error motorlink_st_master_is_lost(struct motorlink_st_master *master, uint8_t *lost);

/**
 * Begins to read a register; `value` of the result is its value. Any number is allowed.
 */
motorlink_error motorlink_st_master_get_register(struct motorlink_st_master *master,
                                                 uint8_t motor,
                                                 motorlink_st_reg reg);

/**
 * Begins to write a register. Of a floating-point register `value` is the bits, of a register of type u32
 * the value's cast to `int32_t`. Registers without a name are allowed; they are written with 4 bytes.
 *
 * `BAD_ARGUMENT`: `motor` is over 7, or `value` is outside of the range of the register's type.
 */
motorlink_error motorlink_st_master_set_register(struct motorlink_st_master *master,
                                                 uint8_t motor,
                                                 motorlink_st_reg reg,
                                                 int32_t value);

/**
 * Begins to execute a command. Any number is allowed.
 *
 * A drive also acknowledges START_MOTOR and FAULT_ACK if they have no effect. After START_MOTOR read
 * STATUS: FAULT_NOW and FAULT_OVER mean that the motor did not start because of the faults in FLAGS,
 * ANY_STOP, STOP, STOP_IDLE and WAIT_STOP_MOTOR that it is still stopping. The motor starts in its
 * control mode, which a stop does not change: in torque mode with the last current reference.
 *
 * What stops a motor (STOP_MOTOR, SC_STOP) is sent at once if the line is lost or was just opened, then
 * the line is recovered, then it is sent again. The result is that of the second. If it is not
 * `MOTORLINK_OK`, begin again: the motor may still turn. A drive acknowledges START_MOTOR also where it has
 * no effect: while the motor runs, is stopping or is in fault. Read STATUS.
 */
motorlink_error motorlink_st_master_execute(struct motorlink_st_master *master,
                                            uint8_t motor,
                                            motorlink_st_command command);

/**
 * Begins to program a speed ramp (4.8): to `speed_rpm` in `duration_ms`; 0 ms is a step.
 */
motorlink_error motorlink_st_master_set_ramp(struct motorlink_st_master *master,
                                             uint8_t motor,
                                             int32_t speed_rpm,
                                             uint16_t duration_ms);

/**
 * Begins to set the references of Iq and Id (4.11), s16A digits.
 */
motorlink_error motorlink_st_master_set_current_reference(struct motorlink_st_master *master,
                                                          uint8_t motor,
                                                          int16_t iq_s16a,
                                                          int16_t id_s16a);

/**
 * Begins to program a torque ramp (profile MCSDK 5.4): to `torque_s16a` in `duration_ms`; 0 ms is
 * a step.
 */
motorlink_error motorlink_st_master_set_torque_ramp(struct motorlink_st_master *master,
                                                    uint8_t motor,
                                                    int32_t torque_s16a,
                                                    uint16_t duration_ms);

/**
 * Begins a move to `angle_rad` in `duration_s` (profile MCSDK 5.4).
 *
 * `BAD_ARGUMENT`: `motor` is over 7, or a value is not finite.
 */
motorlink_error motorlink_st_master_set_position(struct motorlink_st_master *master,
                                                 uint8_t motor,
                                                 float angle_rad,
                                                 float duration_s);

/**
 * Begins to read rev-up phase 0 to 4 (4.9); `motorlink_st_decode_revup_data` reads the result.
 *
 * `BAD_ARGUMENT`: `motor` is over 7, or `phase` over 4.
 */
motorlink_error motorlink_st_master_get_revup_data(struct motorlink_st_master *master,
                                                   uint8_t motor,
                                                   uint8_t phase);

/**
 * Begins to write rev-up phase 0 to 4 (4.10). `data` is copied.
 *
 * `BAD_ARGUMENT`: `motor` is over 7, or `phase` over 4.
 */
motorlink_error motorlink_st_master_set_revup_data(struct motorlink_st_master *master,
                                                   uint8_t motor,
                                                   uint8_t phase,
                                                   const struct motorlink_st_revup_phase *data);

/**
 * Begins to read the SDK's version and name (4.7); `motorlink_st_decode_board_info` reads the
 * result.
 */
motorlink_error motorlink_st_master_get_board_info(struct motorlink_st_master *master,
                                                   uint8_t motor);

/**
 * Begins to read the firmware's version (4.12); `motorlink_st_decode_firmware_version` reads the
 * result.
 */
motorlink_error motorlink_st_master_get_firmware_version(struct motorlink_st_master *master,
                                                         uint8_t motor);

/**
 * Begins to choose the registers of a data segment (profile SPEC): `count` numbers, which are
 * copied. A slave of this library has segments 0 to 3, of up to 32 registers each.
 *
 * `TOO_LONG`: over 127 registers.
 */
motorlink_error motorlink_st_master_configure_segment(struct motorlink_st_master *master,
                                                      uint8_t motor,
                                                      uint8_t segment,
                                                      const motorlink_st_reg *registers,
                                                      size_t count);

/**
 * Begins to read a data segment (profile SPEC): the values of its registers in their order,
 * little-endian, each in its own size.
 *
 * `LIMIT`: this master has not configured the segment since the port was opened. Nothing is sent:
 * shipped firmware reads this request as a torque ramp.
 */
motorlink_error motorlink_st_master_get_segment(struct motorlink_st_master *master,
                                                uint8_t motor,
                                                uint8_t segment);

/**
 * Begins to ask which registers steps of the motor profiler show (profile MCSDK 5.4): `count`
 * numbers of steps, which are copied. The result has the count and the registers of each step.
 *
 * `TOO_LONG`: over 128 steps.
 */
motorlink_error motorlink_st_master_get_profiler_info(struct motorlink_st_master *master,
                                                      uint8_t motor,
                                                      const uint8_t *steps,
                                                      size_t count);

/**
 * Begins a confirmation: a question that shows whether the replies since the last confirmation belong to
 * their own requests. A reply that comes twice, or late, shifts all later replies by one, which no other
 * exchange detects. Confirm what you read before you rely on it, and a stop before the program ends.
 *
 * The result is `MOTORLINK_OK` or `UNCONFIRMED`. After `UNCONFIRMED` do not use what was read or
 * acknowledged since the last confirmation; the line is recovered before the next request.
 */
motorlink_error motorlink_st_master_confirm(struct motorlink_st_master *master);

/**
 * Begins an exchange with any frame code and any payload of up to 128 bytes, which is copied.
 *
 * `BAD_ARGUMENT`: `motor` is over 7, or `code` over 31. `TOO_LONG`: over 128 bytes.
 */
motorlink_error motorlink_st_master_raw(struct motorlink_st_master *master,
                                        uint8_t motor,
                                        motorlink_st_frame_code code,
                                        const uint8_t *payload,
                                        size_t size);

/**
 * Begins a slave for a drive with motors 1 to `motors`, whatever the storage held before.
 *
 * `size` is `sizeof *slave`. `drive` is kept: it has to live as long as the slave is used, and
 * may be constant. Not from a callback of the same slave.
 *
 * `NULL_POINTER`: also if `execute` is NULL. `BAD_ARGUMENT`: `profile` has no name, or `motors` is not 1
 * to 7.
 */
motorlink_error motorlink_st_slave_init(struct motorlink_st_slave *slave,
                                        size_t size,
                                        motorlink_st_profile profile,
                                        uint8_t motors,
                                        const struct motorlink_st_motor_control *drive);

/**
 * Takes a byte that came at `now_us`. If it completes a command, the drive is called, and `reply` is what to
 * send before the next byte is handed in. Otherwise `reply` has no bytes.
 *
 * The bytes belong to the slave, until the next call for it. A byte costs some instructions, a
 * complete command a checksum over it and the callbacks.
 */
motorlink_error motorlink_st_slave_receive(struct motorlink_st_slave *slave,
                                           uint64_t now_us,
                                           uint8_t byte,
                                           struct motorlink_bytes *reply);

/**
 * Call it at the deadline. Gives the error reply to a command that did not arrive completely in time
 * (4.1), or no bytes. The bytes belong to the slave, until the next call for it.
 */
motorlink_error motorlink_st_slave_poll(struct motorlink_st_slave *slave,
                                        uint64_t now_us,
                                        struct motorlink_bytes *reply);

/**
 * Gives the moment at which `motorlink_st_slave_poll` must be called; `MOTORLINK_NEVER` if no command is
 * under way, and always in profile MCSDK 5.4, whose firmware has no timeout.
 */
motorlink_error motorlink_st_slave_deadline(struct motorlink_st_slave *slave,
                                            uint64_t *deadline_us);

/**
 * Call it after the receiver lost bytes (overrun, framing error, noise). Drops the command under way and
 * gives the error reply to send. The bytes belong to the slave, until the next call for it.
 */
motorlink_error motorlink_st_slave_overrun(struct motorlink_st_slave *slave,
                                           struct motorlink_bytes *reply);

/**
 * The name of a register, UTF-8 without a NUL, constant: `printf("%.*s", (int)size, data)`. Empty
 * for a number without a name. This holds for all names here.
 */
struct motorlink_bytes motorlink_st_reg_name(motorlink_st_reg reg);

/**
 * The symbol of the unit of one digit of a register's value, in a profile; empty if it has none. FLUXWK_BUS
 * and FLUXWK_BUS_MEAS have `%` in profile SPEC and `0.1 %` in MCSDK54. All other units are the same.
 */
struct motorlink_bytes motorlink_st_reg_unit(motorlink_st_profile profile,
                                             motorlink_st_reg reg);

/**
 * The name of an error code.
 */
struct motorlink_bytes motorlink_st_error_code_name(motorlink_st_error_code error_code);

/**
 * The name of a state.
 */
struct motorlink_bytes motorlink_st_status_name(motorlink_st_status status);

/**
 * The name of a command.
 */
struct motorlink_bytes motorlink_st_command_name(motorlink_st_command command);

/**
 * An encoder value of a reply as an angle, 0.01° a digit; `encoder_bits` is the encoder's width,
 * 12 to 18. 0 for any other width.
 */
uint16_t motorlink_rmd_encoder_centidegrees(uint16_t counts, uint8_t encoder_bits);

/**
 * Request 0x30: reads the gains in RAM.
 */
struct motorlink_rmd_data motorlink_rmd_read_pid(void);

/**
 * Request 0x31: sets the gains until power-off.
 */
struct motorlink_rmd_data motorlink_rmd_write_pid_ram(struct motorlink_rmd_pid pid);

/**
 * Request 0x32: sets the gains for good. Wears the ROM.
 */
struct motorlink_rmd_data motorlink_rmd_write_pid_rom(struct motorlink_rmd_pid pid);

/**
 * Request 0x33: reads the acceleration limit.
 */
struct motorlink_rmd_data motorlink_rmd_read_acceleration(void);

/**
 * Request 0x34: sets the acceleration limit until power-off.
 *
 * `acceleration_dps2`: 1 °/s² a digit; 0 is no limit.
 */
struct motorlink_rmd_data motorlink_rmd_write_acceleration_ram(int32_t acceleration_dps2);

/**
 * Request 0x90: reads encoder position, original position and offset.
 */
struct motorlink_rmd_data motorlink_rmd_read_encoder(void);

/**
 * Request 0x91: sets the encoder offset, at once and for good. Wears the ROM.
 *
 * `offset`: Encoder counts.
 */
struct motorlink_rmd_data motorlink_rmd_write_encoder_offset_rom(uint16_t offset);

/**
 * Request 0x19: makes the current position the zero effective after the next power cycle. Wears the ROM.
 */
struct motorlink_rmd_data motorlink_rmd_write_zero_rom(void);

/**
 * Request 0x92: reads the angle over all turns.
 */
struct motorlink_rmd_data motorlink_rmd_read_multi_turn_angle(void);

/**
 * Request 0x94: reads the angle within the turn.
 */
struct motorlink_rmd_data motorlink_rmd_read_single_turn_angle(void);

/**
 * Request 0x9A: reads temperature, voltage and error flags.
 */
struct motorlink_rmd_data motorlink_rmd_read_status(void);

/**
 * Request 0x9B: clears the error flags whose cause is gone.
 */
struct motorlink_rmd_data motorlink_rmd_clear_errors(void);

/**
 * Request 0x9C: reads temperature, torque current, speed and encoder position.
 */
struct motorlink_rmd_data motorlink_rmd_read_motion_status(void);

/**
 * Request 0x9D: reads the three phase currents.
 */
struct motorlink_rmd_data motorlink_rmd_read_phase_currents(void);

/**
 * Request 0x80: switches the motor off and forgets what it was doing.
 */
struct motorlink_rmd_data motorlink_rmd_off(void);

/**
 * Request 0x81: stops the motor and remembers what it was doing.
 */
struct motorlink_rmd_data motorlink_rmd_stop(void);

/**
 * Request 0x88: resumes what the motor was doing before the stop.
 */
struct motorlink_rmd_data motorlink_rmd_run(void);

/**
 * Request 0xA1: holds a torque current.
 *
 * `iq_16ma`: 0.016 A a digit, -2000 to 2000.
 */
struct motorlink_rmd_data motorlink_rmd_set_torque(int16_t iq_16ma);

/**
 * Request 0xA2: holds a speed.
 *
 * `speed_centidps`: 0.01 °/s a digit, positive is clockwise.
 */
struct motorlink_rmd_data motorlink_rmd_set_speed(int32_t speed_centidps);

/**
 * Request 0xA3: turns to a multi-turn angle.
 *
 * `angle_centidegrees`: 0.01° a digit, positive is clockwise from zero.
 */
struct motorlink_rmd_data motorlink_rmd_set_position(int32_t angle_centidegrees);

/**
 * Request 0xA4: turns to a multi-turn angle no faster than a limit.
 *
 * `angle_centidegrees`: 0.01° a digit, positive is clockwise from zero.
 * `max_speed_dps`: 1 °/s a digit.
 */
struct motorlink_rmd_data motorlink_rmd_set_position_limited(int32_t angle_centidegrees,
                                                             uint16_t max_speed_dps);

/**
 * Request 0xA5: turns to an angle within the turn, in a given direction.
 *
 * `direction`: Which way to turn.
 * `angle_centidegrees`: 0.01° a digit, 0 to 35999.
 */
struct motorlink_rmd_data motorlink_rmd_set_single_turn_position(motorlink_rmd_spin_direction direction,
                                                                 uint16_t angle_centidegrees);

/**
 * Request 0xA6: turns to an angle within the turn, in a given direction, no faster than a limit.
 *
 * `direction`: Which way to turn.
 * `angle_centidegrees`: 0.01° a digit, 0 to 35999.
 * `max_speed_dps`: 1 °/s a digit.
 */
struct motorlink_rmd_data motorlink_rmd_set_single_turn_position_limited(motorlink_rmd_spin_direction direction,
                                                                         uint16_t angle_centidegrees,
                                                                         uint16_t max_speed_dps);

/**
 * Reads the reply to 0x30, 0x31, 0x32.
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_pid(struct motorlink_rmd_data reply,
                                         struct motorlink_rmd_pid *pid);

/**
 * Reads the reply to 0x33, 0x34: 1 °/s² a digit; 0 is no limit.
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_acceleration(struct motorlink_rmd_data reply,
                                                  int32_t *acceleration_dps2);

/**
 * Reads the reply to 0x90.
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_encoder(struct motorlink_rmd_data reply,
                                             struct motorlink_rmd_encoder *encoder);

/**
 * Reads the reply to 0x92: 0.01° a digit, positive is clockwise; 56 bits travel (SPEC-NOTES.md R2).
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_multi_turn_angle(struct motorlink_rmd_data reply,
                                                      int64_t *angle_centidegrees);

/**
 * Reads the reply to 0x94: 0.01° a digit, 0 to 35999, growing clockwise from the encoder's zero.
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_single_turn_angle(struct motorlink_rmd_data reply,
                                                       uint16_t *angle_centidegrees);

/**
 * Reads the reply to 0x9A, 0x9B.
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_status(struct motorlink_rmd_data reply,
                                            struct motorlink_rmd_status *status);

/**
 * Reads the reply to 0x9C, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6.
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_motion_status(struct motorlink_rmd_data reply,
                                                   struct motorlink_rmd_motion_status *motion_status);

/**
 * Reads the reply to 0x9D.
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_phase_currents(struct motorlink_rmd_data reply,
                                                    struct motorlink_rmd_phase_currents *phase_currents);

/**
 * Reads the reply to 0x91, 0x19: Encoder counts.
 *
 * `BAD_ARGUMENT`: the reply is that of another command.
 */
motorlink_error motorlink_rmd_decode_encoder_offset(struct motorlink_rmd_data reply,
                                                    uint16_t *offset);

/**
 * Begins a host, whatever the storage held before: 50 ms for a reply, 100 ms of quarantine, no
 * limits. `size` is `sizeof *host`. Replies to an earlier host may still come: the first request to
 * each motor is `QUARANTINED`, unless `motorlink_rmd_host_trust` was called.
 */
motorlink_error motorlink_rmd_host_init(struct motorlink_rmd_host *host, size_t size);

/**
 * Sets how long a reply may take, and how long after a timeout a late reply may still come. Effective
 * from the next request.
 *
 * `BAD_ARGUMENT`: a time is 0. Without quarantine a late reply would be taken for another request's.
 */
motorlink_error motorlink_rmd_host_set_times(struct motorlink_rmd_host *host,
                                             uint32_t timeout_us,
                                             uint32_t quarantine_us);

/**
 * Sets the limits of a motor. Effective from the next request.
 *
 * `BAD_ARGUMENT`: `motor` is not 1 to 32, or a limit is neither `MOTORLINK_NO_LIMIT` nor in
 * the range of its kind: 0 to 32767, 0 to 65535, 0 and more.
 */
motorlink_error motorlink_rmd_host_set_limits(struct motorlink_rmd_host *host,
                                              uint8_t motor,
                                              const struct motorlink_rmd_limits *limits);

/**
 * Begins an exchange with a motor: `request` is what one of the functions for requests gives, or
 * any eight bytes.
 *
 * A motor that did not answer before may be asked for its status instead; the exchange ends in
 * `QUARANTINED` then. So does the first one with each motor, in which it is asked for its status
 * by two different questions; when it was silent for the quarantine time the request is taken.
 *
 * Off and Stop are also sent during a quarantine. Exception: if the reply to an earlier Off is missing,
 * another Off gives `QUARANTINED` until the quarantine is over; the same for Stop. To a motor that was not
 * asked before, Off and Stop are sent before the questions.
 *
 * `BAD_ARGUMENT`: `motor` is not 1 to 32. `BUSY`: its last exchange is not over. `LIMIT`: a limit
 * or the document's range is exceeded. `QUARANTINED`: ask again at the time that
 * `motorlink_rmd_host_retry` tells. Nothing is sent then.
 */
motorlink_error motorlink_rmd_host_request(struct motorlink_rmd_host *host,
                                           uint64_t now_us,
                                           uint8_t motor,
                                           struct motorlink_rmd_data request);

/**
 * Begins a confirmation: a question to a motor that shows whether its replies since the last confirmation
 * belong to their own requests. A reply that comes twice answers the next request with the same code, which
 * no other exchange detects. Confirm what you read before you rely on it, and a stop before the program
 * ends.
 *
 * The result is `MOTORLINK_OK`, `UNCONFIRMED`, or an error of the question. If it is not `MOTORLINK_OK`, do
 * not use what the motor replied since the last confirmation.
 *
 * `BAD_ARGUMENT`, `BUSY`, `QUARANTINED`: as `motorlink_rmd_host_request`. Nothing is sent then.
 */
motorlink_error motorlink_rmd_host_confirm(struct motorlink_rmd_host *host,
                                           uint64_t now_us,
                                           uint8_t motor);

/**
 * Begins an exchange with motors 1 to 4 in one frame (0x280): a torque current each, 0.016 A a
 * digit. `expect` has a bit for each motor that has to answer, bit 0 for motor 1. Each of them ends in a
 * `DONE`. The frame reaches all four motors. Those that are not in `expect` are in quarantine afterwards.
 * If a motor of `expect` did not answer its last request, or was not asked before, the frame is not sent:
 * each motor of `expect` is asked for its status, and its exchange ends in `QUARANTINED`.
 *
 * As `motorlink_rmd_host_request`: `BUSY` and `LIMIT` of any of the four, `QUARANTINED` of `expect`.
 * `BAD_ARGUMENT`: a bit above 3 is set.
 */
motorlink_error motorlink_rmd_host_set_torque4(struct motorlink_rmd_host *host,
                                               uint64_t now_us,
                                               const int16_t *iq_16ma,
                                               uint8_t expect);

/**
 * Gives when to ask again after the last `QUARANTINED`, of a call or of an exchange, of any motor. Call it
 * before the next call for another motor. A reply may move the moment.
 */
motorlink_error motorlink_rmd_host_retry(struct motorlink_rmd_host *host,
                                         uint64_t *at_us);

/**
 * What to do next. Call until it is `WAIT`.
 */
motorlink_error motorlink_rmd_host_poll(struct motorlink_rmd_host *host,
                                        uint64_t now_us,
                                        struct motorlink_rmd_output *output);

/**
 * Takes a frame that came from the bus at `now_us`. Frames that belong to no exchange are dropped.
 * An adapter that echoes what was sent looks like a motor that answers: drop its echoes.
 *
 * `BAD_ARGUMENT`: no CAN frame has such a size or identifier.
 */
motorlink_error motorlink_rmd_host_receive(struct motorlink_rmd_host *host,
                                           uint64_t now_us,
                                           const struct motorlink_can_frame *frame);

/**
 * Cancels the exchange with a motor, without a result. Another request can then be made. A frame of
 * `motorlink_rmd_host_set_torque4` that is not yet sent and would reach the motor is cancelled for all.
 *
 * `BAD_ARGUMENT`: `motor` is not 1 to 32.
 */
motorlink_error motorlink_rmd_host_cancel(struct motorlink_rmd_host *host,
                                          uint64_t now_us,
                                          uint8_t motor);

/**
 * Marks these motors as without a pending reply to an earlier host. No question is then sent before the
 * first request. `motors` has a bit for each, bit 0 for motor 1.
 */
motorlink_error motorlink_rmd_host_trust(struct motorlink_rmd_host *host,
                                         uint32_t motors);

/**
 * Call it after the bus was opened again. Late replies may still come, as after
 * `motorlink_rmd_host_init`. Exchanges under way end without a result.
 */
motorlink_error motorlink_rmd_host_reopened(struct motorlink_rmd_host *host, uint64_t now_us);

/**
 * The motors with an exchange under way: a bit each, bit 0 for motor 1.
 */
motorlink_error motorlink_rmd_host_busy(struct motorlink_rmd_host *host, uint32_t *motors);

/**
 * Begins a drive, whatever the storage held before. Before `motorlink_rmd_drive_power_on` it ignores all
 * frames, and does not command its motor.
 *
 * `size` is `sizeof *drive`. `config` and `rom` (what the ROM holds; NULL: zeros) are copied.
 * `motor` is kept: it has to live as long as the drive is used, and may be constant. Not from a
 * callback of the same drive.
 *
 * `NULL_POINTER`: also if `set_mode` is NULL. `BAD_ARGUMENT`: `id` is not 1 to 32, or `encoder_bits`
 * neither 0 nor 12 to 18.
 */
motorlink_error motorlink_rmd_drive_init(struct motorlink_rmd_drive *drive,
                                         size_t size,
                                         const struct motorlink_rmd_drive_config *config,
                                         const struct motorlink_rmd_settings *rom,
                                         const struct motorlink_rmd_motor_control *motor);

/**
 * Starts, also after a power cycle: settings come from ROM, the motor is off, no error is latched
 * and nothing is left to resume.
 */
motorlink_error motorlink_rmd_drive_power_on(struct motorlink_rmd_drive *drive, uint64_t now_us);

/**
 * Takes a frame from the bus that came at `now_us`. `reply` is the frame to send; its id is
 * `MOTORLINK_NO_FRAME` where there is none: frames for others, unknown codes and frames that are
 * not eight bytes of standard data are not answered. `reply` and `frame` may be the same.
 *
 * `BAD_ARGUMENT`: no CAN frame has such a size or identifier.
 */
motorlink_error motorlink_rmd_drive_receive(struct motorlink_rmd_drive *drive,
                                            uint64_t now_us,
                                            const struct motorlink_can_frame *frame,
                                            struct motorlink_can_frame *reply);

/**
 * Latches faults, and switches the motor off after a fault or the shutdown time. Call it each millisecond,
 * also while no frame arrives.
 */
motorlink_error motorlink_rmd_drive_poll(struct motorlink_rmd_drive *drive,
                                         uint64_t now_us);

/**
 * Gives the end of the shutdown time; `MOTORLINK_NEVER` if the motor is off or has no shutdown time. It
 * does not know of faults.
 */
motorlink_error motorlink_rmd_drive_deadline(struct motorlink_rmd_drive *drive,
                                             uint64_t *deadline_us);

/**
 * Gives what the motor does.
 */
motorlink_error motorlink_rmd_drive_motion(struct motorlink_rmd_drive *drive,
                                           struct motorlink_rmd_motion *motion);

/**
 * Gives the latched errors, a sum of `MOTORLINK_RMD_ERROR_*`.
 */
motorlink_error motorlink_rmd_drive_errors(struct motorlink_rmd_drive *drive, uint8_t *errors);

/**
 * Gives the settings in RAM, which commands use.
 */
motorlink_error motorlink_rmd_drive_settings(struct motorlink_rmd_drive *drive,
                                             struct motorlink_rmd_settings *settings);

/**
 * Begins the host's end, for the adapter on a serial line. `size` is `sizeof *host`.
 */
motorlink_error motorlink_slcan_host_init(struct motorlink_slcan_host *host, size_t size);

/**
 * Takes a byte from the adapter. `kind` is what the byte completes, `frame` the frame if it completes
 * one. Lines that are no answer are ignored.
 */
motorlink_error motorlink_slcan_host_receive(struct motorlink_slcan_host *host,
                                             uint8_t byte,
                                             motorlink_slcan_answer *kind,
                                             struct motorlink_can_frame *frame);

/**
 * Gives the lines that open an adapter's channel: end of an earlier line, close, bitrate, open. The
 * adapter answers each of the four, some, or none. RMD motors have 1 000 000 bit/s.
 *
 * `BAD_ARGUMENT`: slcan has no such bitrate (10, 20, 50, 100, 125, 250, 500, 800 or 1000 kbit/s).
 */
motorlink_error motorlink_slcan_open(uint32_t bits_per_second, struct motorlink_slcan_line *line);

/**
 * Gives the line that makes an adapter send a frame.
 *
 * `BAD_ARGUMENT`: no CAN frame has such a size or identifier.
 */
motorlink_error motorlink_slcan_encode(const struct motorlink_can_frame *frame,
                                       struct motorlink_slcan_line *line);

/**
 * Begins the adapter's end, for a drive that speaks slcan itself. `size` is `sizeof *device`.
 */
motorlink_error motorlink_slcan_device_init(struct motorlink_slcan_device *device, size_t size);

/**
 * Takes a byte from the host. `line` is the answer to send, if any. `frame` is the frame that the host
 * sends to the bus; its id is `MOTORLINK_NO_FRAME` if there is none.
 */
motorlink_error motorlink_slcan_device_receive(struct motorlink_slcan_device *device,
                                               uint8_t byte,
                                               struct motorlink_slcan_line *line,
                                               struct motorlink_can_frame *frame);

/**
 * Gives the line for a frame that came from the bus at `now_us`; an empty one if the host has not opened
 * the channel.
 *
 * `BAD_ARGUMENT`: no CAN frame has such a size or identifier.
 */
motorlink_error motorlink_slcan_device_deliver(struct motorlink_slcan_device *device,
                                               uint64_t now_us,
                                               const struct motorlink_can_frame *frame,
                                               struct motorlink_slcan_line *line);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* MOTORLINK_H */
