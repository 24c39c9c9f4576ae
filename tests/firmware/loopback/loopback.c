/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/*
 * Both ends of both protocols in one program, which hands the bytes of one to the other. Exits with 0
 * through the emulator's semihosting, or with the number of the line that failed.
 */
#include <motorlink.h>

int main(void);

static void leave(uint32_t code)
{
    const uint32_t block[] = { 0x20026, code }; /* the program ended by itself */
#ifdef __riscv
    register uint32_t operation __asm("a0") = 0x20;
    register const uint32_t *argument __asm("a1") = block;
    __asm volatile(".option push\n.option norvc\nslli x0, x0, 0x1f\nebreak\nsrai x0, x0, 7\n.option pop"
                   : "+r"(operation) : "r"(argument) : "memory");
#else
    register uint32_t operation __asm("r0") = 0x20;
    register const uint32_t *argument __asm("r1") = block;
    __asm volatile("bkpt 0xab" : "+r"(operation) : "r"(argument) : "memory");
#endif
    for (;;) {
    }
}

#define CHECK(condition) ((condition) ? (void)0 : leave(__LINE__))
#define OK(call) CHECK((call) == MOTORLINK_OK)

static motorlink_st_slave slave;
static motorlink_st_master master;
static motorlink_rmd_drive drive;
static motorlink_rmd_host host;

static int32_t get_register(void *context, uint8_t motor, motorlink_st_reg reg)
{
    (void)context;
    return reg == MOTORLINK_ST_REG_SPEED_MEAS ? -1500 * motor : 0;
}

static void execute(void *context, uint8_t motor, motorlink_st_command command)
{
    (void)context;
    (void)motor;
    (void)command;
}

static void set_mode(void *context, const motorlink_rmd_motion *motion)
{
    (void)context;
    (void)motion;
}

static void sense(void *context, motorlink_rmd_sense *out)
{
    (void)context;
    out->encoder_counts = 3 * 16384 + 4096;
}

/* Reads a speed; returns it. */
static int32_t speed(uint8_t motor)
{
    motorlink_st_output todo;
    motorlink_bytes reply;

    OK(motorlink_st_master_get_register(&master, motor, MOTORLINK_ST_REG_SPEED_MEAS));
    do {
        OK(motorlink_st_master_poll(&master, 1000, &todo));
        for (size_t i = 0; todo.kind == MOTORLINK_OUTPUT_TRANSMIT && i < todo.bytes.size; i++) {
            uint8_t byte = todo.bytes.data[i];
            OK(motorlink_st_slave_receive(&slave, 1000, byte, &reply));
        }
        if (todo.kind == MOTORLINK_OUTPUT_TRANSMIT) {
            OK(motorlink_st_master_receive(&master, 1000, reply.data, reply.size));
        }
        CHECK(todo.kind != MOTORLINK_OUTPUT_WAIT);
    } while (todo.kind != MOTORLINK_OUTPUT_DONE);
    OK(todo.result);
    return todo.value;
}

/* Reads the multi-turn angle; returns it. */
static int64_t angle(uint8_t motor)
{
    motorlink_rmd_output todo;
    motorlink_can_frame reply;
    int64_t centidegrees;

    OK(motorlink_rmd_host_request(&host, 1000, motor, motorlink_rmd_read_multi_turn_angle()));
    for (;;) {
        OK(motorlink_rmd_host_poll(&host, 1000, &todo));
        if (todo.kind == MOTORLINK_OUTPUT_DONE) {
            OK(todo.result);
            OK(motorlink_rmd_decode_multi_turn_angle(todo.reply, &centidegrees));
            return centidegrees;
        }
        CHECK(todo.kind == MOTORLINK_OUTPUT_TRANSMIT);
        OK(motorlink_rmd_drive_receive(&drive, 1000, &todo.frame, &reply));
        CHECK(reply.id != MOTORLINK_NO_FRAME);
        OK(motorlink_rmd_host_receive(&host, 1000, &reply));
    }
}

int main(void)
{
    static motorlink_st_motor_control st_motor;
    static motorlink_rmd_motor_control rmd_motor;
    static motorlink_rmd_drive_config config;

    st_motor.get_register = get_register;
    st_motor.execute = execute;
    OK(motorlink_st_slave_init(&slave, sizeof slave, MOTORLINK_ST_PROFILE_SPEC, 2, &st_motor));
    OK(motorlink_st_master_init(&master, sizeof master, NULL));
    OK(motorlink_st_master_trust_line(&master));
    CHECK(speed(1) == -1500);
    CHECK(speed(2) == -3000);

    rmd_motor.set_mode = set_mode;
    rmd_motor.sense = sense;
    config.id = 7;
    OK(motorlink_rmd_drive_init(&drive, sizeof drive, &config, NULL, &rmd_motor));
    OK(motorlink_rmd_drive_power_on(&drive, 0));
    OK(motorlink_rmd_host_init(&host, sizeof host));
    OK(motorlink_rmd_host_trust(&host, 1u << 6));
    CHECK(angle(7) == 3 * 36000 + 9000);

    leave(0);
    return 0;
}
