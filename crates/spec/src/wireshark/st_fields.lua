-- Preferences, fields and notes of ST's protocol.

local table_of = TABLES.st
local st = Proto("motorlink.st", "ST Motor Control Protocol")
local rtac = Proto("motorlink.rtac", "ST Motor Control Protocol in an RTAC serial capture")
local RTAC_HEADER, RTAC_EVENT = 12, 8
local SENT_EVENTS = { [1] = true, [2] = false, [3] = true, [4] = false }

local profiles = {}
for index, profile in ipairs(table_of.profiles) do
    profiles[index] = { index, profile.name, index }
end
st.prefs.claim = claim_preference(
    "RTAC serial captures. off: only by Decode As. recognised: lines from a packet on that " ..
    "begins with a frame of the protocol. all: every line.")
st.prefs.profile = Pref.enum("Profile", 1, "What the drive follows", profiles, false)
st.prefs.direction = direction_preference(AT_HOST)
st.prefs.silence_ms = Pref.uint("Silence that ends a frame, ms", table_of.silence_ms,
    "A frame is over when no byte of it follows in this time")

local function profile_of()
    return st.prefs.profile
end

local STATES = { [0] = "Bad", [1] = "Good" }
local own = {
    type = ProtoField.uint8("motorlink.st.type", "Type", base.DEC, TYPES),
    source = ProtoField.string("motorlink.st.type.source", "Type from", base.ASCII,
        "The capture, or the header of the frame"),
    message = ProtoField.string("motorlink.st.message", "Message"),
    header = ProtoField.uint8("motorlink.st.header", "Header", base.HEX),
    code = ProtoField.uint8("motorlink.st.code", "Frame code", base.HEX, nil, 0x1F),
    motor = ProtoField.uint8("motorlink.st.motor", "Motor", base.DEC, nil, 0xE0),
    length = ProtoField.uint8("motorlink.st.length", "Length", base.DEC),
    payload = ProtoField.bytes("motorlink.st.payload", "Payload"),
    surplus = ProtoField.bytes("motorlink.st.surplus", "Surplus bytes"),
    checksum = ProtoField.uint8("motorlink.st.checksum", "Checksum", base.HEX),
    expected = ProtoField.uint8("motorlink.st.checksum.calculated", "Calculated checksum",
        base.HEX),
    verdict = ProtoField.uint8("motorlink.st.checksum.status", "Checksum status", base.DEC,
        STATES),
    error = ProtoField.uint8("motorlink.st.error", "Error", base.HEX,
        names_of(table_of.errors)),
    command = ProtoField.uint8("motorlink.st.command", "Command", base.HEX,
        names_of(table_of.commands)),
    register = ProtoField.uint8("motorlink.st.register", "Register", base.HEX,
        names_of(table_of.registers)),
    value = ProtoField.double("motorlink.st.value", "Value", nil,
        "Value of a register in its unit"),
    digits = ProtoField.int64("motorlink.st.digits", "Digits",
        base.DEC, nil, nil, "Integer that a register has in the frame"),
    name = ProtoField.string("motorlink.st.name", "Name"),
    version = ProtoField.string("motorlink.st.version", "Version"),
    stray = ProtoField.bytes("motorlink.st.stray", "Bytes outside all frames"),
    fragment = ProtoField.bytes("motorlink.st.fragment", "Part of a frame"),
    whole_in = ProtoField.framenum("motorlink.st.whole_in", "Whole frame in"),
}
local links = link_fields("motorlink.st.")
local messages, registers, faults = {}, {}, {}

local UNSIGNED = { u8 = true, u16 = true, u32 = true }
local SIZES = { i8 = 1, u8 = 1, i16 = 2, u16 = 2, i32 = 4, u32 = 4, f32 = 4 }
for _, message in pairs(table_of.messages) do
    for _, layout in ipairs({ message.request, message.reply }) do
        for _, field in ipairs(layout) do
            local key = "motorlink.st." .. field.name
            local make = field.type == "f32" and ProtoField.float
                or UNSIGNED[field.type] and ProtoField.uint32 or ProtoField.int32
            messages[field.name] = messages[field.name] or make(key, field.name)
        end
    end
end
local NAMED = { status = table_of.states, mode = table_of.modes, register = table_of.registers }
-- A drive takes values with more bytes than the register has, so numbers may be larger than its type.
local function field_of(register)
    local all_unsigned, any_unsigned = true, false
    for index in ipairs(table_of.profiles) do
        if register.types[index] == "f32" then
            return ProtoField.float
        elseif register.scales[index] ~= 1 then
            return ProtoField.double
        end
        local is_unsigned = register.types[index] == "u32"
        all_unsigned = all_unsigned and is_unsigned
        any_unsigned = any_unsigned or is_unsigned
    end
    return all_unsigned and ProtoField.uint32 or any_unsigned and ProtoField.int64
        or ProtoField.int32
end

for id, register in pairs(table_of.registers) do
    local key = "motorlink.st.reg." .. register.name:lower()
    local rows = NAMED[register.kind]
    local make = field_of(register)
    if make == ProtoField.float or make == ProtoField.double then
        registers[id] = make(key, register.name, nil, register.doc)
    else
        local base_shown = register.kind == "flags" and base.HEX or base.DEC
        registers[id] =
            make(key, register.name, base_shown, rows and names_of(rows), nil, register.doc)
    end
    if register.kind == "flags" then
        for _, fault in ipairs(table_of.faults) do
            for half, shift in pairs({ occurred = 1, present = 65536 }) do
                local of_fault = key .. "." .. fault.name:lower() .. "." .. half
                faults[of_fault] = ProtoField.bool(of_fault, fault.name .. " " .. half, 32, nil,
                    fault.mask * shift, fault.doc)
            end
        end
    end
end

local expert = {
    refused = ProtoExpert.new("motorlink.st.refused", "refused by the drive",
        expert.group.RESPONSE_CODE, expert.severity.WARN),
    checksum = ProtoExpert.new("motorlink.st.bad_checksum", "the checksum does not match",
        expert.group.CHECKSUM, expert.severity.ERROR),
    code = ProtoExpert.new("motorlink.st.unknown_code", "a frame code that the profile lacks",
        expert.group.UNDECODED, expert.severity.WARN),
    short = ProtoExpert.new("motorlink.st.too_short", "the payload is too short",
        expert.group.PROTOCOL, expert.severity.WARN),
    size = ProtoExpert.new("motorlink.st.wrong_size", "not the size of the profile",
        expert.group.PROTOCOL, expert.severity.WARN),
    implausible = ProtoExpert.new("motorlink.st.other_profile", "a value of the other profile",
        expert.group.PROTOCOL, expert.severity.WARN),
    surplus = ProtoExpert.new("motorlink.st.surplus_bytes", "a drive ignores surplus bytes",
        expert.group.PROTOCOL, expert.severity.NOTE),
    faults = ProtoExpert.new("motorlink.st.fault", "faults", expert.group.RESPONSE_CODE,
        expert.severity.WARN),
    unasked = ProtoExpert.new("motorlink.st.unasked", "a reply without a request",
        expert.group.SEQUENCE, expert.severity.NOTE),
    doubtful = ProtoExpert.new("motorlink.st.doubtful", "a reply to one of several requests",
        expert.group.SEQUENCE, expert.severity.NOTE),
    alone = ProtoExpert.new("motorlink.st.no_reply", "no reply in this capture",
        expert.group.SEQUENCE, expert.severity.NOTE),
    stray = ProtoExpert.new("motorlink.st.no_frame", "bytes that are no frame",
        expert.group.PROTOCOL, expert.severity.WARN),
    cut = ProtoExpert.new("motorlink.st.truncated", "the rest of the frame is missing",
        expert.group.PROTOCOL, expert.severity.WARN),
    open = ProtoExpert.new("motorlink.st.incomplete", "the frame goes on in a later packet",
        expert.group.REASSEMBLE, expert.severity.CHAT),
}
st.fields = fields_of(own, links, messages, registers, faults)
st.experts = expert
