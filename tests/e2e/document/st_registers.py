"""Table 3 of the Motor Control Protocol: the registers, row by row.

Types are u8, s8, u16, s16, u32, s32, little endian (end of 4.1).
Access is the table's letter: R, W, RW, or D (HOLES 7).
The last column says on which part of the configuration the register hangs
(4.4, last note): pll, cordic, sensor (Hall or encoder), pfc.
"""
from collections import namedtuple

TYPES = {"u8": (1, False), "s8": (1, True), "u16": (2, False),
         "s16": (2, True), "u32": (4, False), "s32": (4, True)}


class Register(namedtuple("Register", "id name type unit access needs", defaults=("",))):
    """One row of Table 3."""

    @property
    def size(self):
        """Bytes of the value: 1, 2 or 4."""
        return TYPES[self.type][0]

    def pack(self, value):
        """The value as the payload carries it; cut to what the type can hold."""
        size, signed = TYPES[self.type]
        top = (1 << (8 * size - signed)) - 1
        bottom = -top - 1 if signed else 0
        value = max(bottom, min(top, int(round(value))))
        return value.to_bytes(size, "little", signed=signed)

    def unpack(self, data, old):
        """4.4 "Beware!": low bytes are used, missing high bytes stay as in `old`."""
        size, signed = TYPES[self.type]
        data = data[:size]
        data = data + self.pack(old)[len(data):]
        return int.from_bytes(data, "little", signed=signed)


TABLE_3 = [
    Register(0x00, "TARGET_MOTOR", "u8", "-", "RW"),
    Register(0x01, "FLAGS", "u32", "-", "R"),
    Register(0x02, "STATUS", "u8", "-", "R"),
    Register(0x03, "CONTROL_MODE", "u8", "-", "RW"),
    Register(0x04, "SPEED_REF", "s32", "RPM", "R"),
    Register(0x05, "SPEED_KP", "s16", "s16A/'Unit'", "RW"),
    Register(0x06, "SPEED_KI", "s16", "s16A/'Unit'", "RW"),
    Register(0x07, "SPEED_KD", "s16", "s16A/'Unit'", "RW"),
    Register(0x08, "TORQUE_REF", "s16", "s16A", "RW"),
    Register(0x09, "TORQUE_KP", "s16", "s16V/s16A", "RW"),
    Register(0x0A, "TORQUE_KI", "s16", "s16V/s16A", "RW"),
    Register(0x0B, "TORQUE_KD", "s16", "s16V/s16A", "RW"),
    Register(0x0C, "FLUX_REF", "s16", "s16A", "RW"),
    Register(0x0D, "FLUX_KP", "s16", "s16V/s16A", "RW"),
    Register(0x0E, "FLUX_KI", "s16", "s16V/s16A", "RW"),
    Register(0x0F, "FLUX_KD", "s16", "s16V/s16A", "RW"),
    Register(0x10, "OBSERVER_C1", "s16", "N/A", "RW", "pll"),
    Register(0x11, "OBSERVER_C2", "s16", "N/A", "RW", "pll"),
    Register(0x12, "OBSERVER_CR_C1", "s16", "N/A", "RW", "cordic"),
    Register(0x13, "OBSERVER_CR_C2", "s16", "N/A", "RW", "cordic"),
    Register(0x14, "PLL_KI", "s16", "dpp/s16V", "RW", "pll"),
    Register(0x15, "PLL_KP", "s16", "dpp/s16V", "RW", "pll"),
    Register(0x16, "FLUXWK_KP", "s16", "s16A/(s16V ²)", "RW"),
    Register(0x17, "FLUXWK_KI", "s16", "s16A/(s16V ²)", "RW"),
    Register(0x18, "FLUXWK_BUS", "u16", "%", "RW"),
    Register(0x19, "BUS_VOLTAGE", "u16", "V", "R"),
    Register(0x1A, "HEATS_TEMP", "u16", "°C", "R"),
    Register(0x1B, "MOTOR_POWER", "u16", "W", "R"),
    Register(0x1C, "DAC_OUT1", "u8", "N/A", "RW"),
    Register(0x1D, "DAC_OUT2", "u8", "N/A", "RW"),
    Register(0x1E, "SPEED_MEAS", "s32", "RPM", "R"),
    Register(0x1F, "TORQUE_MEAS", "s16", "s16A", "R"),
    Register(0x20, "FLUX_MEAS", "s16", "s16A", "R"),
    Register(0x21, "FLUXWK_BUS_MEAS", "u16", "%", "R"),
    Register(0x22, "RUC_STAGE_NBR", "u8", "-", "R"),
    Register(0x23, "I_A", "s16", "s16A", "D"),
    Register(0x24, "I_B", "s16", "s16A", "D"),
    Register(0x25, "I_ALPHA", "s16", "s16A", "D"),
    Register(0x26, "I_BETA", "s16", "s16A", "D"),
    Register(0x27, "I_Q", "s16", "s16A", "D"),
    Register(0x28, "I_D", "s16", "s16A", "D"),
    Register(0x29, "I_Q_REF", "s16", "s16A", "D"),
    Register(0x2A, "I_D_REF", "s16", "s16A", "D"),
    Register(0x2B, "V_Q", "s16", "s16V", "D"),
    Register(0x2C, "V_D", "s16", "s16V", "D"),
    Register(0x2D, "V_ALPHA", "s16", "s16V", "D"),
    Register(0x2E, "V_BETA", "s16", "s16V", "D"),
    Register(0x2F, "MEAS_EL_ANGLE", "s16", "s16degree", "D", "sensor"),
    Register(0x30, "MEAS_ROT_SPEED", "s16", "s16speed", "D", "sensor"),
    Register(0x31, "OBS_EL_ANGLE", "s16", "s16degree", "D", "pll"),
    Register(0x32, "OBS_ROT_SPEED", "s16", "s16speed", "D", "pll"),
    Register(0x33, "OBS_I_ALPHA", "s16", "s16A", "D", "pll"),
    Register(0x34, "OBS_I_BETA", "s16", "s16A", "D", "pll"),
    Register(0x35, "OBS_BEMF_ALPHA", "s16", "s16V", "D", "pll"),
    Register(0x36, "OBS_BEMF_BETA", "s16", "s16V", "D", "pll"),
    Register(0x37, "OBS_CR_EL_ANGLE", "s16", "s16degree", "D", "cordic"),
    Register(0x38, "OBS_CR_ROT_SPEED", "s16", "s16speed", "D", "cordic"),
    Register(0x39, "OBS_CR_I_ALPHA", "s16", "s16A", "D", "cordic"),
    Register(0x3A, "OBS_CR_I_BETA", "s16", "s16A", "D", "cordic"),
    Register(0x3B, "OBS_CR_BEMF_ALPHA", "s16", "s16V", "D", "cordic"),
    Register(0x3C, "OBS_CR_BEMF_BETA", "s16", "s16V", "D", "cordic"),
    Register(0x3D, "DAC_USER1", "s16", "N/A", "D"),
    Register(0x3E, "DAC_USER2", "s16", "N/A", "D"),
    Register(0x3F, "MAX_APP_SPEED", "u32", "RPM", "R"),
    Register(0x40, "MIN_APP_SPEED", "u32", "RPM", "R"),
    Register(0x41, "IQ_SPEEDMODE", "s16", "s16A", "W"),
    Register(0x42, "EST_BEMF_LEVEL", "s16", "s16V ²", "R", "pll"),
    Register(0x43, "OBS_BEMF_LEVEL", "s16", "s16V ²", "R", "pll"),
    Register(0x44, "EST_CR_BEMF_LEVEL", "s16", "s16V ²", "R", "cordic"),
    Register(0x45, "OBS_CR_BEMF_LEVEL", "s16", "s16V ²", "R", "cordic"),
    Register(0x46, "FF_1Q", "s32", "N/A", "RW"),
    Register(0x47, "FF_1D", "s32", "N/A", "RW"),
    Register(0x48, "FF_2", "s32", "N/A", "RW"),
    Register(0x49, "FF_VQ", "s16", "s16V", "R"),
    Register(0x4A, "FF_VD", "s16", "s16V", "R"),
    Register(0x4B, "FF_VQ_PIOUT", "s16", "s16V/s16A", "R"),
    Register(0x4C, "FF_VD_PIOUT", "s16", "s16V/s16A", "R"),
    Register(0x4D, "PFC_STATUS", "s8", "-", "R", "pfc"),
    Register(0x4E, "PFC_FAULTS", "u32", "-", "R", "pfc"),
    Register(0x4F, "PFC_DCBUS_REF", "s16", "V", "RW", "pfc"),
    Register(0x50, "PFC_DCBUS_MEAS", "s16", "V", "R", "pfc"),
    Register(0x51, "PFC_ACBUS_FREQ", "s16", "01Hz", "R", "pfc"),
    Register(0x52, "PFC_ACBUS_RMS", "s16", "V", "R", "pfc"),
    Register(0x53, "PFC_I_KP", "s16", "s16V/s16A", "RW", "pfc"),
    Register(0x54, "PFC_I_KI", "s16", "s16V/s16A", "RW", "pfc"),
    Register(0x55, "PFC_I_KD", "s16", "s16V/s16A", "RW", "pfc"),
    Register(0x56, "PFC_V_KP", "s16", "s16A/V", "RW", "pfc"),
    Register(0x57, "PFC_V_KI", "s16", "s16A/V", "RW", "pfc"),
    Register(0x58, "PFC_V_KD", "s16", "s16A/V", "RW", "pfc"),
    Register(0x59, "PFC_STARTUP_DURATION", "s16", "ms", "RW", "pfc"),
    Register(0x5A, "PFC_ENABLED", "s8", "-", "R", "pfc"),
    Register(0x5B, "RAMP_FINAL_SPEED", "s32", "RPM", "RW"),
    Register(0x6E, "SPEED_KP_DIV", "s16", "N/A", "R"),
    Register(0x6F, "SPEED_KI_DIV", "s16", "N/A", "R"),
    Register(0x72, "CTRBID", "u32", "-", "R"),
    Register(0x73, "PWBDID", "u32", "-", "R"),
    Register(0x81, "PWBDID2", "u32", "-", "R"),
]

REGISTERS = {register.id: register for register in TABLE_3}
BY_NAME = {register.name: register for register in TABLE_3}

# Start values of the registers that are plain variables (HOLES 21).
DEFAULTS = {
    "SPEED_KP": 2000, "SPEED_KI": 1000, "SPEED_KD": 0,
    "TORQUE_KP": 3000, "TORQUE_KI": 1500, "TORQUE_KD": 0,
    "FLUX_KP": 3000, "FLUX_KI": 1500, "FLUX_KD": 0,
    "OBSERVER_C1": -15000, "OBSERVER_C2": 12000,
    "OBSERVER_CR_C1": -14000, "OBSERVER_CR_C2": 11000,
    "PLL_KI": 50, "PLL_KP": 700,
    "FLUXWK_KP": 3000, "FLUXWK_KI": 5000, "FLUXWK_BUS": 98,
    "DAC_OUT1": 0x23, "DAC_OUT2": 0x24,
    "FF_1Q": 1000, "FF_1D": 1000, "FF_2": 2000,
    "PFC_DCBUS_REF": 400, "PFC_I_KP": 100, "PFC_I_KI": 10, "PFC_I_KD": 0,
    "PFC_V_KP": 200, "PFC_V_KI": 20, "PFC_V_KD": 0, "PFC_STARTUP_DURATION": 100,
    "SPEED_KP_DIV": 256, "SPEED_KI_DIV": 16384,
    "CTRBID": 0x00C0FFEE, "PWBDID": 0x00010001, "PWBDID2": 0x00010002,
}
