-- Frames of ST drives on a serial line.

local lines, sent

-- The message of a request; nil if the profile lacks its code.
local function message_of(request)
    return table_of.codes[profile_of()][code_of(request.bytes:byte(1))]
end

local function segment_of(request)
    return request.bytes:byte(3)
end

-- Requests that are kept. A capture may have no replies.
local MOST_PENDING = 64

-- A drive replies in the order of the requests, or not at all.
local function ask(line, request)
    if message_of(request) == table_of.segment.configure then
        -- Until the acknowledge it may have the old registers or the new ones.
        line.segments[segment_of(request)] = nil
    end
    local first = line.pending[1]
    while first and (#line.pending == MOST_PENDING
        or (request.time - first.time) * 1000 >= st.prefs.silence_ms) do
        table.remove(line.pending, 1)
        first = line.pending[1]
    end
    line.pending[#line.pending + 1] = request
end

-- A damaged frame may have been a reply, or a request.
local function lose(line)
    table.remove(line.pending, 1)
    for at, request in ipairs(line.pending) do
        line.pending[at] = { bytes = "", time = request.time }
    end
end

-- Takes the request that a reply with this payload answers. Returns it, and whether it is certain.
local function take_answered(line, takes)
    local first, is_certain = nil, true
    for at, request in ipairs(line.pending) do
        if takes(request) then
            first = first or at
            is_certain = is_certain and request.bytes == line.pending[first].bytes
        end
    end
    -- None takes it: it has a wrong size for the first one.
    local answered = line.pending[first or 1]
    for _ = 1, first or 1 do
        table.remove(line.pending, 1)
    end
    return answered, is_certain
end

local function understand(line, frame)
    local header = frame.bytes:byte(1)
    frame.direction = frame.direction or (is_reply(header) and REPLY or REQUEST)
    line.pending = line.pending or {}
    if not frame.is_good then
        return lose(line)
    end
    if frame.direction == REQUEST then
        return ask(line, frame)
    end
    local reply = table_of.replies[header]
    if reply == "ATR" then
        return
    end
    local request, is_certain = take_answered(line, function(request)
        return reply ~= "ACK" or takes_size(request.bytes, #frame.bytes - table_of.overhead)
    end)
    if not request or not is_certain or request.bytes == "" then
        frame.is_doubtful = request ~= nil
        return
    end
    frame.to, request.by = request, frame
    local message = message_of(request)
    if reply == "ACK" and message == table_of.segment.configure then
        line.segments[segment_of(request)] = request.bytes:sub(4, -2)
    elseif message == table_of.segment.read then
        frame.registers = line.segments[segment_of(request)]
    end
end

local function forget()
    sent = {}
    lines = new_lines({
        max_payload = table_of.max_payload,
        overhead = table_of.overhead,
        begins = function(header, direction)
            return direction ~= REPLY or is_reply(header)
        end,
        is_known = function(header, direction)
            if direction ~= REQUEST and is_reply(header) then
                return true
            end
            return direction ~= REPLY
                and table_of.codes[profile_of()][code_of(header)] ~= nil
        end,
        understand = understand,
    })
end
forget()
st.init = forget

local function add_request(tree, frame, range, profile, item)
    local header = frame.bytes:byte(1)
    local name = table_of.codes[profile][code_of(header)]
    local motor = math.floor(header / 32)
    local tail = motor > 0 and string.format(", motor %d", motor) or ""
    if not name then
        item:add_proto_expert_info(expert.code)
        return string.format("frame code 0x%02x%s", code_of(header), tail)
    end
    tree:add(own.message, name):set_generated()
    local message = table_of.messages[name]
    local text, size
    if message.takes then
        text, size = REQUESTS[message.takes](tree, range, profile, message)
    else
        local texts
        texts, size = add_layout(tree, range, message.request)
        text = texts and table.concat(texts, ", ")
    end
    if not text then
        tree:add_proto_expert_info(expert.short,
            "the payload is too short: a drive answers " .. message.too_short)
        return name .. ", too short" .. tail
    end
    if size < range:len() then
        tree:add(own.surplus, range(size)):add_proto_expert_info(expert.surplus)
    end
    return (text == "" and name or name .. " " .. text) .. tail
end

local function add_acknowledge(tree, frame, range, profile)
    if frame.is_doubtful then
        tree:add_proto_expert_info(expert.doubtful)
        return range:len() == 0 and "ACK"
            or string.format("ACK, %d bytes, to one of several requests", range:len())
    end
    if not frame.to then
        tree:add_proto_expert_info(expert.unasked)
        return string.format("ACK, %d bytes without a request", range:len())
    end
    local name = table_of.codes[profile][code_of(frame.to.bytes:byte(1))]
    local message = table_of.messages[name]
    local text
    if not message then
        return string.format("ACK, %d bytes", range:len())
    elseif message.gives then
        text = REPLIES[message.gives](tree, range, profile, frame)
    else
        local texts, size = add_layout(tree, range, message.reply)
        text = size == range:len() and table.concat(texts, ", ") or nil
    end
    if not text then
        tree:add_proto_expert_info(expert.size, string.format(
            "%d bytes are no reply to %s", range:len(), name))
        return string.format("ACK, %d bytes", range:len())
    end
    return text == "" and "ACK" or "ACK " .. text
end

local function add_reply(tree, frame, range, profile)
    local name = table_of.replies[frame.bytes:byte(1)]
    tree:add(own.message, name):set_generated()
    if name == "ATR" then
        return "identification, unasked"
    elseif name == "ACK" then
        return add_acknowledge(tree, frame, range, profile)
    end
    if range:len() == 0 then
        tree:add_proto_expert_info(expert.refused, "NACK without a code")
        return "NACK without a code"
    end
    local number = range(0, 1):uint()
    local row = table_of.errors[number]
    local text = string.format("NACK %s: %s", named(table_of.errors, number),
        row and row.doc or table_of.unknown_doc)
    tree:add(own.error, range(0, 1)):add_proto_expert_info(expert.refused, text)
    if not frame.to then
        tree:add_proto_expert_info(frame.is_doubtful and expert.doubtful or expert.unasked)
    end
    return text
end

local function add_header(tree, range, direction)
    local item = tree:add(own.header, range)
    if direction == REQUEST then
        item = tree:add(own.code, range)
        tree:add(own.motor, range)
    end
    return item
end

local function add_frame(tree, pinfo, frame, range)
    local profile = profile_of()
    local size = range:len()
    tree:add(own.type, frame.direction):set_generated()
    tree:add(own.source, frame.told and "capture" or "header"):set_generated()
    local item = add_header(tree, range(0, 1), frame.direction)
    tree:add(own.length, range(1, 1))
    local payload = size > table_of.overhead and range(2, size - table_of.overhead)
        or range:tvb()(2, 0)
    local text
    if payload:len() > 0 then
        tree:add(own.payload, payload)
    end
    if frame.is_good and frame.direction == REQUEST then
        text = add_request(tree, frame, payload, profile, item)
    elseif frame.is_good then
        text = add_reply(tree, frame, payload, profile)
    end
    local checksum = tree:add(own.checksum, range(size - 1, 1))
    tree:add(own.verdict, range(size - 1, 1), frame.is_good and 1 or 0):set_generated()
    if not frame.is_good then
        local expected = checksum_of(frame.bytes, 1, size - 1)
        checksum:add(own.expected, range(size - 1, 1), expected):set_generated()
        text = string.format("bad checksum 0x%02x instead of 0x%02x", frame.bytes:byte(size),
            expected)
        checksum:add_proto_expert_info(expert.checksum, text)
    end
    add_links(tree, links, frame.time, frame.to, frame.by)
    -- Whether a reply follows is known once all packets were read.
    if frame.is_good and frame.direction == REQUEST and pinfo.visited and not frame.by then
        tree:add_proto_expert_info(expert.alone)
    end
    return text
end

-- The part of a frame that is in this packet, or that has no end.
local function add_fragment(tree, item, range)
    tree:add(own.fragment, range)
    if item.kind == "part" then
        if item.whole.kind == "frame" then
            tree:add(own.whole_in, item.whole.number):set_generated()
        end
        return "part of a frame"
    end
    if item.direction then
        tree:add(own.type, item.direction):set_generated()
        -- A fragment behind the first packet of its frame has no header.
        if item.bytes:sub(1, range:len()) == range:raw() then
            add_header(tree, range(0, 1), item.direction)
            if range:len() > 1 then
                tree:add(own.length, range(1, 1))
            end
        end
    end
    local length = item.bytes:byte(2)
    local size = length and tostring(length + table_of.overhead) or "?"
    local text = string.format("%d of %s bytes of a frame", #item.bytes, size)
    tree:add_proto_expert_info(item.kind == "cut" and expert.cut or expert.open, text)
    return item.kind == "cut" and "truncated: " .. text or text
end

local function add_item(tvb, pinfo, root, item)
    local range = tvb(item.offset, item.size)
    local tree = root:add(st, range)
    local text
    if item.kind == "stray" then
        text = string.format("%d bytes that are no frame", item.size)
        tree:add(own.stray, range):add_proto_expert_info(expert.stray, text)
    elseif item.kind == "frame" then
        if item.size < #item.bytes then
            local whole = ByteArray.new(item.bytes, true):tvb("Reassembled frame")
            range = whole()
        end
        text = add_frame(tree, pinfo, item, range)
    else
        text = add_fragment(tree, item, range)
    end
    local arrow = item.direction == REPLY and "< " or item.direction and "> " or ""
    tree:append_text(", " .. arrow .. text)
    return arrow .. text
end

-- `sent` has what the header of an RTAC serial capture says.
local function direction_here(pinfo)
    local told = sent[pinfo.number]
    if told == nil then
        told = was_sent(pinfo)
    end
    return direction_of(told, st.prefs.direction)
end

local function dissect(tvb, pinfo, root)
    if tvb:len() == 0 then
        return 0
    end
    if not lines.packets[pinfo.number] then
        lines.feed(line_of(pinfo), pinfo.number, pinfo.rel_ts, direction_here(pinfo),
            tvb():raw(), st.prefs.silence_ms / 1000)
    end
    local texts = {}
    for _, item in ipairs(lines.packets[pinfo.number]) do
        texts[#texts + 1] = add_item(tvb, pinfo, root, item)
    end
    pinfo.cols.protocol = "ST"
    pinfo.cols.info = table.concat(texts, " | ")
    return tvb:len()
end

-- Wireshark's own dissector shows the header of the capture. It offers its payload by Decode As
-- only, so that a line is recognised here.
local serial = Dissector.get("rtacser")

local function is_claimed(tvb, pinfo)
    local claim, line = st.prefs.claim, line_of(pinfo)
    if tvb:len() <= RTAC_HEADER or claim == OFF then
        return false
    end
    if claim == ALL or lines.packets[pinfo.number] then
        return true
    end
    if not pinfo.visited and not lines.is_recognised(line) then
        if lines.is_frame(tvb(RTAC_HEADER):raw(), direction_here(pinfo)) then
            lines.recognise(line)
        end
    end
    return not pinfo.visited and lines.is_recognised(line) or false
end

function rtac.dissector(tvb, pinfo, root)
    if tvb:len() >= RTAC_HEADER then
        sent[pinfo.number] = SENT_EVENTS[tvb(RTAC_EVENT, 1):uint()]
    end
    if not is_claimed(tvb, pinfo) then
        serial:call(tvb, pinfo, root)
        return tvb:len()
    end
    serial:call(tvb(0, RTAC_HEADER):tvb(), pinfo, root)
    Dissector.get("motorlink.st"):call(tvb(RTAC_HEADER):tvb(), pinfo, root)
    return tvb:len()
end

st.dissector = dissect
DissectorTable.get("rtacser.data"):add_for_decode_as(st)
DissectorTable.get("wtap_encap"):add(wtap_encaps.RTAC_SERIAL, rtac)
