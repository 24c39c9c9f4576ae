-- What both protocols use. The tables above are generated, the code is not.

local UNKNOWN, REQUEST, REPLY = 0, 1, 2
local TYPES = { [UNKNOWN] = "request or reply", [REQUEST] = "request", [REPLY] = "reply" }
local OFF, RECOGNISED, ALL = 1, 2, 3
local AT_HOST, AT_DRIVE, UNTOLD, AUTO = 1, 2, 3, 4

local frame_interface = Field.new("frame.interface_id")

-- The number of the interface is a field of the tree. Wireshark builds the tree while it reads a capture
-- if a tap wants it.
Listener.new("frame", nil, true)

-- Numbers of the interfaces keep the lines of a capture apart. A pcap file has one line.
local function line_of(pinfo)
    local interface = frame_interface()
    return interface and interface.value or 0
end

local function claim_preference(what)
    return Pref.enum("Claim frames", RECOGNISED, what, {
        { 1, "off", OFF },
        { 2, "recognised", RECOGNISED },
        { 3, "all", ALL },
    }, false)
end

local function direction_preference(default)
    local words = {
        { 1, "host", AT_HOST },
        { 2, "drive", AT_DRIVE },
        { 3, "untold", UNTOLD },
    }
    if default == AUTO then
        words[4] = { 4, "auto", AUTO }
    end
    return Pref.enum("Direction", default,
        "host: sent frames are requests. drive: received frames are. untold: the direction of the " ..
        "capture is ignored. auto: replies show who captured.", words, false)
end

-- `sent` is nil if the capture does not tell.
local function direction_of(sent, preference)
    if sent == nil or preference == UNTOLD or preference == AUTO then
        return nil
    end
    if preference == AT_DRIVE then
        sent = not sent
    end
    return sent and REQUEST or REPLY
end

-- Whether the machine that captured the frame sent it. Wireshark's numbers are those of its C code; not
-- every version has names for them in Lua.
local DIRECTION_SENT, DIRECTION_RECEIVED = 0, 1
local function was_sent(pinfo)
    if pinfo.p2p_dir == DIRECTION_SENT then
        return true
    end
    if pinfo.p2p_dir == DIRECTION_RECEIVED then
        return false
    end
    return nil
end

-- Names with their numbers, as value strings.
local function names_of(rows)
    local names = {}
    for number, row in pairs(rows) do
        names[number] = row.name
    end
    return names
end

local function named(rows, number)
    local row = rows[number]
    return row and row.name or string.format("0x%02x", number)
end

local function hex(bytes)
    return (bytes:gsub(".", function(byte)
        return string.format(" %02X", byte:byte())
    end))
end

local function fields_of(...)
    local all = {}
    for _, fields in ipairs({ ... }) do
        for _, field in pairs(fields) do
            all[#all + 1] = field
        end
    end
    return all
end

-- The fields that join a request and its reply.
local function link_fields(prefix)
    return {
        response_in = ProtoField.framenum(prefix .. "response_in", "Reply in", base.NONE,
            frametype.RESPONSE),
        response_to = ProtoField.framenum(prefix .. "response_to", "Reply to", base.NONE,
            frametype.REQUEST),
        response_time = ProtoField.relative_time(prefix .. "response_time", "Response time",
            "Time between request and reply"),
    }
end

local function time_between(first, last)
    local seconds = last - first
    local whole = math.floor(seconds)
    return NSTime.new(whole, math.floor((seconds - whole) * 1e9 + 0.5))
end

-- `to` and `by` are the other frame, with its number and time.
local function add_links(tree, fields, time, to, by)
    if by then
        tree:add(fields.response_in, by.number):set_generated()
    end
    if to then
        tree:add(fields.response_to, to.number):set_generated()
        tree:add(fields.response_time, time_between(to.time, time)):set_generated()
    end
end
