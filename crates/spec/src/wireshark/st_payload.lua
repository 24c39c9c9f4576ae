-- Values in payloads of ST's protocol.

local function code_of(header)
    return header % 32
end

local function is_reply(header)
    return table_of.replies[header] ~= nil
end

-- The text before the first NUL, cut before the first byte that is not UTF-8.
local function text_of(bytes)
    bytes = bytes:match("^[^%z]*")
    local at = 1
    while at <= #bytes do
        local a, b = bytes:byte(at, at + 1)
        local size, least, most = 1, 0x80, 0xBF
        if a >= 0xF5 or (a >= 0x80 and a < 0xC2) then
            return bytes:sub(1, at - 1)
        elseif a >= 0xF0 then
            size = 4
            least, most = a == 0xF0 and 0x90 or 0x80, a == 0xF4 and 0x8F or 0xBF
        elseif a >= 0xE0 then
            size = 3
            least, most = a == 0xE0 and 0xA0 or 0x80, a == 0xED and 0x9F or 0xBF
        elseif a >= 0xC2 then
            size = 2
        end
        if size > 1 and not (b and b >= least and b <= most) then
            return bytes:sub(1, at - 1)
        end
        for further = at + 2, at + size - 1 do
            local c = bytes:byte(further)
            if not c or c < 0x80 or c > 0xBF then
                return bytes:sub(1, at - 1)
            end
        end
        at = at + size
    end
    return bytes
end

local function printable(text)
    return (text:gsub("%c", "."))
end

-- The value of a type with its digits. Values have little-endian bytes.
local function number_of(range, type)
    if type == "f32" then
        return range:le_float(), range:le_uint()
    end
    local digits = UNSIGNED[type] and range:le_uint() or range:le_int()
    return digits, digits
end

-- The shortest text that is this float.
local function float_shown(value)
    for places = 6, 9 do
        local text = string.format("%." .. places .. "g", value)
        if Struct.unpack("<f", Struct.pack("<f", tonumber(text) or value)) == value then
            return text
        end
    end
    return tostring(value)
end

local function with_unit(text, unit)
    return unit == "" and text or text .. " " .. unit
end

local function flags_shown(bits)
    local words = {}
    for place = 0, 15 do
        local mask = 2 ^ place
        local occurred = math.floor(bits / mask) % 2 == 1
        local present = math.floor(bits / 65536 / mask) % 2 == 1
        if occurred or present then
            local word = string.format("0x%04x", mask)
            for _, fault in ipairs(table_of.faults) do
                word = fault.mask == mask and fault.name or word
            end
            words[#words + 1] = word .. (present and " (present)" or "")
        end
    end
    return #words > 0 and table.concat(words, ", ") or "none"
end

local function value_shown(register, value, digits, profile)
    if NAMED[register.kind] then
        return named(NAMED[register.kind], digits % 256)
    elseif register.kind == "flags" then
        return flags_shown(digits % 4294967296)
    elseif register.kind == "motor" then
        return string.format("motor %d", digits + 1)
    elseif register.types[profile] == "f32" then
        return with_unit(float_shown(value), register.unit)
    end
    local places = register.scales[profile] == 1 and "%d" or "%.1f"
    return with_unit(string.format(places, value):gsub("%.0$", ""), register.unit)
end

-- Scales are parts of ten: digits / 10 is exact to the last place, digits * 0.1 is not.
local function scaled(value, scale)
    return scale == 1 and value or value / math.floor(1 / scale + 0.5)
end

-- What is wrong with a value of 16 bits that only a drive of the other profile can give; nil if nothing.
local function implausible_shown(range, register, profile)
    local limits, number = register.other_profile_only[profile], range:le_uint()
    if not limits or number < limits[1] or number > limits[2] then
        return nil
    end
    local texts = {}
    for index, row in ipairs(table_of.profiles) do
        local value, digits = number_of(range, register.types[index])
        local text = value_shown(register, scaled(value, register.scales[index]), digits, index)
        texts[index == profile and 1 or 2] = text .. " in profile " .. row.name
    end
    return string.format("%s is %s, which is not plausible, and %s", register.name, texts[1],
        texts[2])
end

-- Adds the value of a register. Returns its text; nil if the size allows none.
local function add_value(tree, range, id, profile)
    local size = range:len()
    local register = table_of.registers[id]
    local type = register and register.types[profile] or "u32"
    if size ~= 1 and size ~= 2 and size ~= 4 or type == "f32" and size ~= 4 then
        return nil
    end
    if size == 4 and type ~= "f32" and type ~= "u32" then
        type = "i32"
    end
    local value, digits = number_of(range, type)
    if not register then
        tree:add(own.digits, range, Int64.new(digits))
        return string.format("%d", digits)
    end
    local shown = scaled(value, register.scales[profile])
    local text = value_shown(register, shown, digits, profile)
    local is_wide = field_of(register) == ProtoField.int64
    local item = tree:add(registers[id], range, is_wide and Int64.new(shown) or shown)
    item:set_text(register.name .. ": " .. text)
    item:add(own.value, range, shown):set_generated()
    item:add(own.digits, range, Int64.new(digits)):set_generated()
    if register.kind == "flags" then
        for _, fault in ipairs(table_of.faults) do
            for _, half in ipairs({ "occurred", "present" }) do
                local key = "motorlink.st.reg." .. register.name:lower() .. "."
                    .. fault.name:lower() .. "." .. half
                item:add_le(faults[key], range)
            end
        end
        if digits ~= 0 then
            item:add_proto_expert_info(expert.faults, text)
        end
    elseif register.kind == "status" and table_of.fault_states[digits] then
        item:add_proto_expert_info(expert.faults, text)
    end
    return text
end

local function size_of(layout)
    local size = 0
    for _, field in ipairs(layout) do
        size = size + SIZES[field.type]
    end
    return size
end

-- Adds the values of a fixed layout. Returns their texts and the number of bytes; nil if it is too
-- short.
local function add_layout(tree, range, layout)
    local size, texts = size_of(layout), {}
    if range:len() < size then
        return nil
    end
    local at = 0
    for _, field in ipairs(layout) do
        local bytes = range(at, SIZES[field.type])
        local value = number_of(bytes, field.type)
        local item = tree:add(messages[field.name], bytes, value)
        local text = field.type == "f32" and float_shown(value) or string.format("%d", value)
        text = with_unit(text, field.unit)
        item:set_text(field.name .. ": " .. text)
        texts[#texts + 1] = field.label .. " " .. text
        at = at + SIZES[field.type]
    end
    return texts, size
end

local function add_registers(tree, range)
    local names = {}
    for at = 0, range:len() - 1 do
        names[#names + 1] = named(table_of.registers, range(at, 1):uint())
        tree:add(own.register, range(at, 1))
    end
    return table.concat(names, " ")
end

local function add_segment(tree, range, ids, profile)
    local size = 0
    for at = 1, #ids do
        local register = table_of.registers[ids:byte(at)]
        if not register then
            return nil
        end
        size = size + SIZES[register.types[1]]
    end
    if size ~= range:len() then
        return nil
    end
    local texts, at = {}, 0
    for index = 1, #ids do
        local id = ids:byte(index)
        local register = table_of.registers[id]
        local bytes = range(at, SIZES[register.types[1]])
        texts[index] = register.name .. " " .. add_value(tree, bytes, id, profile)
        at = at + bytes:len()
    end
    return table.concat(texts, ", ")
end

-- What the payload of a request says. Returns its text and the number of bytes that count; nil if
-- the payload is too short.
local REQUESTS = {
    register = function(tree, range)
        if range:len() < 1 then
            return nil
        end
        local id = range(0, 1):uint()
        tree:add(own.register, range(0, 1))
        return named(table_of.registers, id), 1
    end,
    register_and_value = function(tree, range, profile)
        if range:len() < 1 then
            return nil
        end
        local id = range(0, 1):uint()
        local register = table_of.registers[id]
        local item = tree:add(own.register, range(0, 1))
        local text = named(table_of.registers, id)
        local size = range:len() - 1
        local shown = size > 0 and add_value(tree, range(1), id, profile)
        if register and size ~= register.write_sizes[profile] then
            item:add_proto_expert_info(expert.size, string.format(
                "%d bytes, a drive takes %d", size, register.write_sizes[profile]))
        end
        return shown and text .. " = " .. shown or text, range:len()
    end,
    command = function(tree, range)
        if range:len() < 1 then
            return nil
        end
        tree:add(own.command, range(0, 1))
        return named(table_of.commands, range(0, 1):uint()), 1
    end,
    registers = function(tree, range, profile, message)
        local texts, size = add_layout(tree, range, message.request)
        if not texts then
            return nil
        end
        local names = size < range:len() and add_registers(tree, range(size)) or ""
        return texts[1] .. ": " .. names, range:len()
    end,
    bytes = function(tree, range)
        return hex(range:raw()):sub(2), range:len()
    end,
}

-- Whether the acknowledge of a request may have this size.
local function takes_size(request, size)
    local name = #request > 0 and table_of.codes[profile_of()][code_of(request:byte(1))]
    local message = name and table_of.messages[name]
    if not message or message.gives and message.gives ~= "register_value" then
        return true
    elseif not message.gives then
        return size == size_of(message.reply)
    end
    local register = table_of.registers[request:byte(3)]
    local expected = register and register.read_sizes[profile_of()] or 0
    if expected == 0 then
        return size == 1 or size == 2 or size == 4
    end
    return size == expected
end

local REPLIES = {
    register_value = function(tree, range, profile, frame)
        local request = frame.to.bytes
        if #request == table_of.overhead or not takes_size(request, range:len()) then
            return nil
        end
        local id = request:byte(3)
        local register = table_of.registers[id]
        local wrong = register and implausible_shown(range, register, profile)
        if wrong then
            tree:add_proto_expert_info(expert.implausible, wrong)
            return wrong
        end
        return add_value(tree, range, id, profile)
    end,
    board_info = function(tree, range)
        if range:len() < 3 then
            return nil
        end
        local parts = { range:raw():byte(1, 3) }
        local is_ascii = range:raw():match("^%d%d%d") ~= nil
        local version = {}
        for at = 1, 3 do
            version[at] = tostring(is_ascii and parts[at] - 48 or parts[at])
        end
        local text = table.concat(version, ".")
        tree:add(own.version, range(0, 3), text)
        local name = range:len() > 3 and text_of(range:raw():sub(4)) or ""
        if range:len() > 3 then
            tree:add(own.name, range(3), name)
        end
        return printable(name) .. " " .. text
    end,
    firmware_version = function(tree, range)
        local bytes = range:raw()
        local at = bytes:find("[\t%z]") or #bytes + 1
        local name, version = text_of(bytes:sub(1, at - 1)), text_of(bytes:sub(at + 1))
        tree:add(own.name, range(0, math.min(at, #bytes)), name)
        if at < #bytes then
            tree:add(own.version, range(at), version)
        end
        return printable(name .. " " .. version)
    end,
    bytes = function(tree, range)
        return hex(range:raw()):sub(2)
    end,
    segment = function(tree, range, profile, frame)
        return frame.registers and add_segment(tree, range, frame.registers, profile)
    end,
}
