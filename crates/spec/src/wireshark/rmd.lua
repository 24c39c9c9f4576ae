-- RMD motors on a CAN bus.

local table_of = TABLES.rmd
local rmd = Proto("motorlink.rmd", "RMD motor control protocol")
local claim = Proto("motorlink.can", "RMD motors by CAN identifier")
local can_remote = Field.new("can.flags.rtr")
local can_fd = Field.new("canfd.flags.esi")

rmd.prefs.claim = claim_preference(
    "off: only by Decode As. recognised: frames whose identifier and first byte are those of " ..
    "a command. all: every frame with an identifier of the protocol.")
rmd.prefs.direction = direction_preference(AUTO)
rmd.prefs.patience_ms = Pref.uint("Longest wait for a reply, ms", table_of.patience_ms,
    "Without direction: a frame is the reply to a request that is not older than this.")

local own = {
    motor = ProtoField.uint8("motorlink.rmd.motor", "Motor", base.DEC),
    type = ProtoField.uint8("motorlink.rmd.type", "Type", base.DEC, TYPES),
    source = ProtoField.string("motorlink.rmd.type.source", "Type from", base.ASCII,
        "The capture, the order of the frames, or the frame itself"),
    code = ProtoField.uint8("motorlink.rmd.code", "Code", base.HEX,
        names_of(table_of.commands)),
    dialect = ProtoField.string("motorlink.rmd.dialect", "Dialect"),
}
local links = link_fields("motorlink.rmd.")
local values = {}
local expert = {
    code = ProtoExpert.new("motorlink.rmd.unknown_code", "not a command of the protocol",
        expert.group.UNDECODED, expert.severity.WARN),
    size = ProtoExpert.new("motorlink.rmd.wrong_size", "not a standard data frame of 8 bytes",
        expert.group.PROTOCOL, expert.severity.WARN),
    dialect = ProtoExpert.new("motorlink.rmd.other_dialect", "a reply of a similar protocol",
        expert.group.PROTOCOL, expert.severity.NOTE),
    active = ProtoExpert.new("motorlink.rmd.error_active", "a protection is active",
        expert.group.RESPONSE_CODE, expert.severity.WARN),
    rom = ProtoExpert.new("motorlink.rmd.rom_write", "writes the ROM, which wears",
        expert.group.REQUEST_CODE, expert.severity.NOTE),
    alone = ProtoExpert.new("motorlink.rmd.no_reply", "no reply in this capture",
        expert.group.SEQUENCE, expert.severity.NOTE),
}

local function declare(field)
    local abbreviation = "motorlink.rmd." .. field.key
    if values[abbreviation] then
        return
    end
    local digits = abbreviation .. ".digits"
    if field.words then
        values[abbreviation] =
            ProtoField.uint8(abbreviation, field.key, base.DEC, field.words, nil, field.doc)
    elseif field.bits then
        values[abbreviation] =
            ProtoField.uint8(abbreviation, field.key, base.HEX, nil, nil, field.doc)
        for _, bit in ipairs(field.bits) do
            local key = abbreviation .. "." .. bit.name:lower()
            values[key] = ProtoField.bool(key, bit.doc, 8, nil, bit.mask)
        end
    elseif field.symbol == "" then
        values[abbreviation] =
            ProtoField.int64(abbreviation, field.key, base.DEC, nil, nil, field.doc)
    else
        -- Commands and replies have the same quantity in different digits.
        values[abbreviation] = ProtoField.double(abbreviation, field.key, nil, field.doc)
        values[digits] = ProtoField.int64(digits, "digits")
    end
end

local function declare_all(fields)
    for _, field in ipairs(fields) do
        declare(field)
    end
end
for _, command in pairs(table_of.commands) do
    declare_all(command.request)
    declare_all(command.reply)
end
declare_all(table_of.torque4)

rmd.fields = fields_of(own, links, values)
rmd.experts = expert

-- What was found in a capture: its frames, and the exchanges on each bus.
local packets, buses, seen, identifiers

local function forget()
    packets, buses, seen, identifiers = {}, {}, {}, {}
end
forget()
rmd.init = forget

local function value_of(field, digits)
    local parts = math.floor(1 / field.digit + 0.5)
    if parts > 1 and 1 / parts == field.digit then
        return digits / parts
    end
    return digits * field.digit
end

local function is_active(field, number)
    for _, bit in ipairs(field.bits) do
        if math.floor(number / bit.mask) % 2 == 1 then
            return true
        end
    end
    return false
end

local function bits_shown(field, number)
    local words, unnamed = {}, number
    for _, bit in ipairs(field.bits) do
        if math.floor(number / bit.mask) % 2 == 1 then
            words[#words + 1] = bit.doc
            unnamed = unnamed - bit.mask
        end
    end
    local text = #words > 0 and table.concat(words, ", ") or "no error"
    if unnamed ~= 0 then
        text = text .. string.format(" (bits 0x%02x mean nothing)", unnamed)
    end
    return text
end

-- Digits with a decimal point. A double holds fewer digits than the longest angle has.
local function exact(digits, decimals)
    local sign, text = tostring(digits):match("^(%-?)(%d+)$")
    text = string.rep("0", decimals + 1 - #text) .. text
    return sign .. text:sub(1, -decimals - 1) .. "." .. text:sub(-decimals)
end

-- The text of a value, its number, and its digits.
local function read(field, range)
    if field.words then
        local number = range:uint()
        return field.words[number] or string.format("0x%02x", number), number
    elseif field.bits then
        return bits_shown(field, range:uint()), range:uint()
    end
    local digits = field.signed and range:le_int64() or range:le_uint64()
    local number = digits:tonumber()
    if field.symbol == "" then
        return string.format("%d", number), Int64.new(number)
    end
    local value = value_of(field, number)
    local text = string.format("%." .. field.decimals .. "f", value)
    if field.decimals > 0 and math.floor(1 / field.digit + 0.5) == 10 ^ field.decimals then
        text = exact(digits, field.decimals)
    end
    return text .. " " .. field.symbol, value,
        field.signed and digits or Int64.new(number)
end

-- Adds the fields to the tree. Returns their text.
local function add_fields(tree, fields, tvb)
    local shown = {}
    for _, field in ipairs(fields) do
        local range = tvb(field.offset, field.len)
        local key = "motorlink.rmd." .. field.key
        local text, value, digits = read(field, range)
        local item = tree:add(values[key], range, value)
        item:set_text(field.name .. ": " .. text)
        if digits then
            item:add(values[key .. ".digits"], range, digits):set_generated()
        end
        for _, bit in ipairs(field.bits or {}) do
            item:add(values[key .. "." .. bit.name:lower()], range)
        end
        if field.bits and is_active(field, value) then
            item:add_proto_expert_info(expert.active, text)
        end
        shown[#shown + 1] = " " .. field.name .. " " .. text
    end
    return table.concat(shown, ",")
end

local function describe(fields, tvb)
    local shown = {}
    for index, field in ipairs(fields) do
        shown[index] = " " .. field.name .. " " .. read(field, tvb(field.offset, field.len))
    end
    return table.concat(shown, ",")
end

-- The bytes that the request of each command does not use.
for _, command in pairs(table_of.commands) do
    local used = {}
    for _, field in ipairs(command.request) do
        for at = field.offset, field.offset + field.len - 1 do
            used[at] = true
        end
    end
    command.unused = {}
    for at = 1, 7 do
        if not used[at] then
            table.insert(command.unused, at)
        end
    end
end

-- Whether the bytes that the request does not use are 0, as hosts send them.
local function may_be_request(command, tvb)
    local bytes = tvb:raw()
    for _, at in ipairs(command.unused) do
        if bytes:byte(at + 1) ~= 0 then
            return false
        end
    end
    return true
end

local function is_late(earlier, now)
    return (now - earlier) * 1000 > rmd.prefs.patience_ms
end

-- A motor has the last request of each code that has no reply yet, in the order of time: a host may
-- send several at once. Returns the place of the one to which a frame with this code may be the reply.
local function place_of(motor, code, now)
    for place, open in ipairs(motor.open) do
        for _, asked in ipairs(table_of.answers[code] or { code }) do
            if open.code == asked and not is_late(open.frame.time, now) then
                return place
            end
        end
    end
end

local function add_open(motor, frame, code)
    for place = #motor.open, 1, -1 do
        local open = motor.open[place]
        if open.code == code or is_late(open.frame.time, frame.time) then
            table.remove(motor.open, place)
        end
    end
    motor.open[#motor.open + 1] = { frame = frame, code = code }
end

-- Request and reply have the same identifier and code. What a frame is comes from the user, from the
-- frame itself, from the direction of the capture once it is known who captured, or from the order of
-- frames. `motorlink decode` has the same rules. Returns the type and its source.
local function type_of(line, motor, frame, command, tvb, sent)
    local told = direction_of(sent, rmd.prefs.direction)
    if told then
        return told, "capture"
    end
    if rmd.prefs.direction ~= AUTO then
        sent = nil
    end
    line.has_received = line.has_received or sent == false
    if command and not may_be_request(command, tvb) then
        if sent then
            line.sender = AT_DRIVE
        end
        return REPLY, "frame"
    end
    if sent and line.sender == nil and not frame.answers then
        line.sender = AT_HOST
    end
    -- If nothing was received, both ends may be on this machine.
    local is_told = line.has_received or line.sender == AT_HOST and not frame.answers
    if sent ~= nil and line.sender and is_told then
        local type = direction_of(sent, line.sender)
        if type == REQUEST or frame.answers then
            return type, "capture"
        end
        -- A reply to a request that is not in the capture, or a request of another host.
        return UNKNOWN, "nothing"
    end
    -- The reply, or the request again because the motor is silent.
    if frame.answers then
        return UNKNOWN, "nothing"
    end
    -- No reply comes so late behind the frame before.
    if motor.is_synced or motor.last and is_late(motor.last, frame.time) then
        return REQUEST, "order"
    end
    return UNKNOWN, "nothing"
end

local function bus_of(pinfo)
    local id = line_of(pinfo)
    buses[id] = buses[id] or { motors = {} }
    return buses[id]
end

local function motor_at(bus, id)
    bus.motors[id] = bus.motors[id] or { open = {} }
    return bus.motors[id]
end

local function understand(pinfo, tvb, id, code)
    local known = packets[pinfo.number]
    if known then
        return known
    end
    local bus = bus_of(pinfo)
    local motor = motor_at(bus, id)
    local frame = { number = pinfo.number, time = pinfo.rel_ts, by = {} }
    local place = place_of(motor, code, frame.time)
    frame.answers = place ~= nil
    frame.type, frame.source =
        type_of(bus, motor, frame, table_of.commands[code], tvb, was_sent(pinfo))
    motor.last = frame.time
    if frame.type == REPLY then
        if place then
            frame.to = motor.open[place].frame
            frame.to.by[id] = frame
        end
        -- A motor replies in the order of the requests: earlier ones get no reply any more.
        for _ = 1, place or 0 do
            table.remove(motor.open, 1)
        end
    elseif frame.type == REQUEST or frame.answers then
        add_open(motor, frame, code)
    end
    motor.is_synced = motor.is_synced or frame.type ~= UNKNOWN
    packets[pinfo.number] = frame
    return frame
end

local function ask_four(pinfo)
    local known = packets[pinfo.number]
    if known then
        return known
    end
    local frame = { number = pinfo.number, time = pinfo.rel_ts, by = {} }
    frame.type, frame.source = REQUEST, "frame"
    for id = 1, #table_of.torque4 do
        local motor = motor_at(bus_of(pinfo), id)
        add_open(motor, frame, table_of.torque4_code)
        motor.is_synced, motor.last = true, frame.time
    end
    packets[pinfo.number] = frame
    return frame
end

local function add_type(tree, frame)
    tree:add(own.type, frame.type):set_generated()
    tree:add(own.source, frame.source):set_generated()
end

local function add_replies(tree, pinfo, frame)
    local replies = 0
    for motor = 1, next(frame.by) and table_of.motors or 0 do
        if frame.by[motor] then
            add_links(tree, links, frame.time, nil, frame.by[motor])
            replies = replies + 1
        end
    end
    if frame.to then
        add_links(tree, links, frame.time, frame.to, nil)
    end
    -- Whether a reply follows is known once all packets were read.
    if frame.type == REQUEST and pinfo.visited and replies == 0 then
        tree:add_proto_expert_info(expert.alone)
    end
end

local function add_torques(tvb, pinfo, root)
    local tree = root:add(rmd, tvb())
    local frame = ask_four(pinfo)
    add_type(tree, frame)
    local text = "motors 1 to 4: Multiple motor torque closed loop control:"
        .. add_fields(tree, table_of.torque4, tvb)
    add_replies(tree, pinfo, frame)
    return tree, text
end

-- The values of a command. None are certain while the type is not, unless request and reply have the
-- same values.
local function add_values(tree, command, type, tvb)
    if type == UNKNOWN and not command.echo then
        return ": request" .. describe(command.request, tvb)
            .. ", or reply" .. describe(command.reply, tvb)
    end
    local shown = add_fields(tree, type == REPLY and command.reply or command.request, tvb)
    return shown == "" and "" or ":" .. shown
end

local ARROWS = { [UNKNOWN] = "?", [REQUEST] = ">", [REPLY] = "<" }

local function add_exchange(tvb, pinfo, root, motor)
    local tree = root:add(rmd, tvb())
    local code = tvb(0, 1):uint()
    local command = table_of.commands[code]
    local frame = understand(pinfo, tvb, motor, code)
    tree:add(own.motor, motor):set_generated()
    add_type(tree, frame)
    local text = string.format("motor %d %s 0x%02X", motor, ARROWS[frame.type], code)
    local item = tree:add(own.code, tvb(0, 1))
    if command then
        text = text .. " " .. command.name .. add_values(tree, command, frame.type, tvb)
        if command.rom and frame.type == REQUEST then
            item:add_proto_expert_info(expert.rom)
        end
    else
        text = text .. " not a command of " .. table_of.version .. ":" .. hex(tvb():raw())
        item:add_proto_expert_info(expert.code)
    end
    add_replies(tree, pinfo, frame)
    return tree, text
end

-- The motor of an identifier, and the dialect if it is a reply of a similar protocol.
local function motor_of(id)
    for _, range in ipairs(table_of.identifiers) do
        if id > range.base and id <= range.base + table_of.motors then
            return id - range.base, range.dialect
        end
    end
end

local function is_ours(id)
    local motor, dialect = motor_of(id)
    return id == table_of.torque4_id or motor ~= nil and not dialect
end

-- Whether the packet has a data frame of 8 bytes.
local function is_whole(tvb)
    local remote = can_remote()
    local is_remote = remote ~= nil and remote.value ~= false and remote.value ~= 0
    return not is_remote and not can_fd() and tvb:len() == 8 and tvb:reported_len() == 8
end

local function dissect(tvb, pinfo, root)
    local id = identifiers[pinfo.number]
    if not id or tvb:len() == 0 then
        return 0
    end
    local motor, dialect = motor_of(id)
    local tree, text
    if dialect then
        tree = root:add(rmd, tvb())
        tree:add(own.dialect, dialect):set_generated()
        tree:add(own.motor, motor):set_generated()
        tree:add_proto_expert_info(expert.dialect)
        text = string.format("reply of a %s motor, ID %d:%s", dialect, motor, hex(tvb():raw()))
    elseif not is_whole(tvb) then
        tree = root:add(rmd, tvb())
        tree:add_proto_expert_info(expert.size)
        text = string.format("0x%03x: not a standard data frame of 8 bytes", id)
    elseif id == table_of.torque4_id then
        tree, text = add_torques(tvb, pinfo, root)
    else
        tree, text = add_exchange(tvb, pinfo, root, motor)
    end
    pinfo.cols.protocol = "RMD"
    pinfo.cols.info = text
    tree:append_text(", " .. text)
    return tvb:len()
end

-- Frames of other protocols may have the same identifiers. The frame for four motors has no code:
-- it is recognised behind a frame of one of them.
local function is_recognised(tvb, pinfo, id)
    if not is_whole(tvb) then
        return false
    end
    local line = line_of(pinfo)
    if id == table_of.torque4_id then
        return seen[line] ~= nil and seen[line] <= pinfo.number
    end
    if not table_of.commands[tvb(0, 1):uint()] then
        return false
    end
    if motor_of(id) <= #table_of.torque4 then
        seen[line] = math.min(seen[line] or pinfo.number, pinfo.number)
    end
    return true
end

-- Only the table of identifiers tells the identifier while Wireshark builds no tree, as when it reads
-- a capture for the first time. What is not claimed here goes on to other dissectors.
function claim.dissector(tvb, pinfo, root)
    local id, preference = pinfo.match_uint, rmd.prefs.claim
    identifiers[pinfo.number] = id
    if preference == OFF or not is_ours(id) then
        return 0
    end
    if preference == RECOGNISED and not is_recognised(tvb, pinfo, id) then
        return 0
    end
    return Dissector.get("motorlink.rmd"):call(tvb, pinfo, root)
end

rmd.dissector = dissect
DissectorTable.get("can.subdissector"):add_for_decode_as(rmd)
for _, range in ipairs(table_of.identifiers) do
    DissectorTable.get("can.id"):add(
        string.format("%d-%d", range.base + 1, range.base + table_of.motors), claim)
end
DissectorTable.get("can.id"):add(table_of.torque4_id, claim)
