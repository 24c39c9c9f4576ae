"""What each register of Table 3 reads from, and writes to, in the model.

A name that is in neither table is a plain variable: what is written is what is
read (Motor.values).
"""
import st_drive as m
from st_frames import GET_WRITE_ONLY, SET_READ_ONLY, WRONG_SET, Nack
from st_registers import REGISTERS

# name -> function(drive, motor): registers that show the model.
# `drive` is the whole slave (it knows the current motor).
READERS = {
    "TARGET_MOTOR": lambda d, x: d.current,
    "FLAGS": lambda d, x: x.flags(),
    "STATUS": lambda d, x: x.state,
    "CONTROL_MODE": lambda d, x: x.mode,
    "SPEED_REF": lambda d, x: x.speed_ref,
    "TORQUE_REF": lambda d, x: x.torque_ref,
    "FLUX_REF": lambda d, x: x.flux_ref,
    "BUS_VOLTAGE": lambda d, x: m.BUS_VOLTS,
    "HEATS_TEMP": lambda d, x: m.HEATSINK_DEGREES,
    "MOTOR_POWER": lambda d, x: x.power(),
    "SPEED_MEAS": lambda d, x: x.speed,
    "TORQUE_MEAS": lambda d, x: x.iq,
    "FLUX_MEAS": lambda d, x: x.id(),
    "FLUXWK_BUS_MEAS": lambda d, x: abs(x.vq()) / 327.67,
    "RUC_STAGE_NBR": lambda d, x: m.REVUP_PHASES,
    "I_A": lambda d, x: x.phase_a_b()[0],
    "I_B": lambda d, x: x.phase_a_b()[1],
    "I_ALPHA": lambda d, x: x.alpha_beta(x.iq, x.id())[0],
    "I_BETA": lambda d, x: x.alpha_beta(x.iq, x.id())[1],
    "I_Q": lambda d, x: x.iq,
    "I_D": lambda d, x: x.id(),
    "I_Q_REF": lambda d, x: x.torque_ref,
    "I_D_REF": lambda d, x: x.flux_ref,
    "V_Q": lambda d, x: x.vq(),
    "V_D": lambda d, x: x.vd(),
    "V_ALPHA": lambda d, x: x.alpha_beta(x.vq(), x.vd())[0],
    "V_BETA": lambda d, x: x.alpha_beta(x.vq(), x.vd())[1],
    "MEAS_EL_ANGLE": lambda d, x: x.angle_s16(),
    "MEAS_ROT_SPEED": lambda d, x: x.speed_s16(),
    "MAX_APP_SPEED": lambda d, x: x.max_speed,
    "MIN_APP_SPEED": lambda d, x: 0,
    "FF_VQ_PIOUT": lambda d, x: x.vq(),
    "FF_VD_PIOUT": lambda d, x: x.vd(),
    "PFC_STATUS": lambda d, x: 2 if x.pfc_faults_past else int(x.pfc_on),
    "PFC_FAULTS": lambda d, x: (x.pfc_faults_now << 16) | x.pfc_faults_past,
    "PFC_DCBUS_MEAS": lambda d, x: x.values["PFC_DCBUS_REF"] if x.pfc_on else 325,
    "PFC_ACBUS_FREQ": lambda d, x: 500,
    "PFC_ACBUS_RMS": lambda d, x: 325,
    "PFC_ENABLED": lambda d, x: x.pfc_on,
    "RAMP_FINAL_SPEED": lambda d, x: x.final_speed,
}

# Both observers see what there is.
for _prefix in ("OBS_", "OBS_CR_"):
    READERS[_prefix + "EL_ANGLE"] = READERS["MEAS_EL_ANGLE"]
    READERS[_prefix + "ROT_SPEED"] = READERS["MEAS_ROT_SPEED"]
    READERS[_prefix + "I_ALPHA"] = READERS["I_ALPHA"]
    READERS[_prefix + "I_BETA"] = READERS["I_BETA"]
    READERS[_prefix + "BEMF_ALPHA"] = lambda d, x: x.alpha_beta(x.speed_s16() * 0.8, 0)[0]
    READERS[_prefix + "BEMF_BETA"] = lambda d, x: x.alpha_beta(x.speed_s16() * 0.8, 0)[1]
for _name in ("EST_BEMF_LEVEL", "OBS_BEMF_LEVEL", "EST_CR_BEMF_LEVEL", "OBS_CR_BEMF_LEVEL"):
    READERS[_name] = lambda d, x: (x.speed_s16() * 0.8) ** 2 / 32768.0


def _write_target_motor(drive, motor, value):
    if not 1 <= value <= len(drive.motors):
        raise Nack(WRONG_SET)
    drive.current = value


def _write_control_mode(drive, motor, value):
    if value not in (m.TORQUE_MODE, m.SPEED_MODE):
        raise Nack(WRONG_SET)
    motor.set_mode(value)


def _write_torque_ref(drive, motor, value):
    motor.torque_ref = value


def _write_flux_ref(drive, motor, value):
    motor.flux_ref = value


def _write_ramp_final_speed(drive, motor, value):
    motor.set_ramp(value, 0.0)


# name -> function(drive, motor, value): registers whose writing does something.
WRITERS = {
    "TARGET_MOTOR": _write_target_motor,
    "CONTROL_MODE": _write_control_mode,
    "TORQUE_REF": _write_torque_ref,
    "FLUX_REF": _write_flux_ref,
    "IQ_SPEEDMODE": _write_flux_ref,        # Table 3: "synonym to Flux reference"
    "RAMP_FINAL_SPEED": _write_ramp_final_speed,
}


def exists(motor, register):
    """4.4, last note: some registers hang on the configuration."""
    if register.needs == "":
        return True
    if register.needs == "pfc":
        return motor.has_pfc
    if register.needs == "sensor":
        return bool(motor.sensors & {"hall", "encoder"})
    return register.needs in motor.sensors


def _find(motor, reg_id, letters, error):
    register = REGISTERS.get(reg_id)
    if register is None or not exists(motor, register):
        raise Nack(error)
    if not set(register.access) & set(letters):
        raise Nack(error)
    return register


def current_value(drive, motor, register):
    """The value of a register, whatever its access."""
    if register.name == "IQ_SPEEDMODE":
        return motor.flux_ref
    reader = READERS.get(register.name)
    return reader(drive, motor) if reader else motor.values.get(register.name, 0)


def read_register(drive, motor, reg_id):
    """4.5: the value as bytes, or NACK GET_WRITE_ONLY."""
    letters = "RD" if drive.read_d else "R"
    register = _find(motor, reg_id, letters, GET_WRITE_ONLY)
    return register.pack(current_value(drive, motor, register))


def write_register(drive, motor, reg_id, data):
    """4.4: write, or NACK SET_READ_ONLY (or WRONG_SET, HOLES 6)."""
    register = _find(motor, reg_id, "W", SET_READ_ONLY)
    if not data:
        return                      # no value at all (HOLES 17)
    value = register.unpack(data, current_value(drive, motor, register))
    writer = WRITERS.get(register.name)
    if writer:
        writer(drive, motor, value)
    else:
        motor.values[register.name] = value
