-- The bytes of a serial line as frames. A packet of a capture may have a part of a frame, or several
-- frames. What a packet holds is found once, when the packets are read in their order.

local function checksum_of(bytes, from, to)
    local sum = 0
    for at = from, to do
        sum = sum + bytes:byte(at)
    end
    sum = sum % 65536
    return (math.floor(sum / 256) + sum) % 256
end

-- The two directions of each line, of each interface. `rules` has the frame format, and
-- `begins(header, direction)`: whether a frame of this direction may begin with the byte.
local function new_lines(rules)
    local lines = {}
    local self = { packets = {} }

    -- "more", "stray", or "frame" with its size and whether its checksum matches.
    local function parse(bytes, from, direction)
        local header, length = bytes:byte(from, from + 1)
        if not rules.begins(header, direction) then
            return "stray"
        end
        if not length then
            return "more"
        end
        if length > rules.max_payload then
            return "stray"
        end
        local last = from + length + rules.overhead - 1
        if last > #bytes then
            return "more"
        end
        local size = length + rules.overhead
        return "frame", size, checksum_of(bytes, from, last - 1) == bytes:byte(last)
    end

    -- The next whole frame of the protocol from here on, and its size.
    local function find(bytes, from, direction)
        for at = from, #bytes do
            local found, size, is_good = parse(bytes, at, direction)
            if found == "frame" and is_good and rules.is_known(bytes:byte(at), direction) then
                return at, size
            end
        end
    end

    -- Finds the next whole frame behind a place. It is searched once for all bytes before it: a packet
    -- may have many bytes that are no frame.
    local function new_search(bytes, direction)
        local is_searched, next_at, next_size = false, nil, nil
        return function(from)
            if not is_searched or next_at and next_at <= from then
                is_searched = true
                next_at, next_size = find(bytes, from + 1, direction)
            end
            return next_at, next_size
        end
    end

    -- The number of bytes that are not part of a frame, if the frame at `from` has no right checksum or
    -- is not whole.
    local function stray(bytes, from, direction, search, found, size, is_over)
        local next_at, next_size = search(from)
        if found == "stray" then
            if next_at then
                return next_at - from
            end
            for at = from + 1, #bytes do
                if direction == REPLY and rules.begins(bytes:byte(at), direction) then
                    return at - from
                end
            end
            return #bytes - from + 1
        end
        if not next_at then
            return nil
        end
        if found == "frame" then
            return next_at < from + size and next_at - from or nil
        end
        -- A frame that is not whole yet may have bytes that look like a frame. It ends with them if
        -- nothing follows.
        local ends_here = next_at + next_size - 1 == #bytes
        return (is_over or ends_here) and next_at - from or nil
    end

    local function items_of(number)
        self.packets[number] = self.packets[number] or {}
        return self.packets[number]
    end

    -- Takes the next bytes of a stream out of its packets, as one item.
    local function take(stream, size, item)
        local parts = {}
        item.bytes = stream.bytes:sub(stream.at, stream.at + size - 1)
        stream.at = stream.at + size
        while size > 0 do
            local part = stream.parts[1]
            local here = math.min(size, part.size)
            parts[#parts + 1] = { number = part.number, offset = part.offset, size = here }
            part.offset, part.size = part.offset + here, part.size - here
            if part.size == 0 then
                table.remove(stream.parts, 1)
            end
            size = size - here
        end
        local last = parts[#parts]
        item.number, item.offset, item.size = last.number, last.offset, last.size
        for index, part in ipairs(parts) do
            local items = items_of(part.number)
            if index == #parts then
                items[#items + 1] = item
            else
                items[#items + 1] = { kind = "part", whole = item, offset = part.offset,
                    size = part.size, direction = item.direction, told = item.told }
            end
        end
        return item
    end

    local function new_item(kind, stream)
        return { kind = kind, direction = stream.direction, told = stream.direction ~= nil }
    end

    -- Splits what a stream has. `is_over`: nothing more belongs to it.
    local function split(line, stream, time, is_over)
        for _, part in ipairs(stream.parts) do
            local items = items_of(part.number)
            if items[#items] and items[#items].kind == "open" then
                table.remove(items)
            end
        end
        local bytes = stream.bytes
        local search = new_search(bytes, stream.direction)
        while stream.at <= #bytes do
            local at = stream.at
            local found, size, is_good = parse(bytes, at, stream.direction)
            local skipped = nil
            if not is_good then
                skipped = stray(bytes, at, stream.direction, search, found, size, is_over)
            end
            if skipped then
                take(stream, skipped, new_item("stray", stream))
            elseif found == "frame" then
                local frame = take(stream, size, new_item("frame", stream))
                frame.is_good, frame.time = is_good, time
                rules.understand(line, frame)
            elseif is_over then
                take(stream, #bytes - at + 1, new_item("cut", stream))
            else
                break
            end
        end
        stream.bytes, stream.at = stream.bytes:sub(stream.at), 1
        for _, part in ipairs(stream.parts) do
            local items = items_of(part.number)
            local item = new_item("open", stream)
            item.bytes, item.offset, item.size = stream.bytes, part.offset, part.size
            items[#items + 1] = item
        end
    end

    local function line_at(id)
        lines[id] = lines[id] or { streams = {}, segments = {} }
        return lines[id]
    end

    -- Whether the bytes begin with a whole frame of the protocol.
    function self.is_frame(bytes, direction)
        return #bytes > 0 and find(bytes:sub(1, rules.max_payload + rules.overhead), 1, direction) == 1
    end

    function self.is_recognised(id)
        return line_at(id).is_recognised
    end

    function self.recognise(id)
        line_at(id).is_recognised = true
    end

    -- Takes the bytes of a packet. One end speaks at a time: a frame is over when the other end speaks,
    -- or after a silence.
    function self.feed(id, number, time, direction, bytes, silence)
        local line = line_at(id)
        items_of(number)
        for other, stream in pairs(line.streams) do
            local is_silent = time - stream.time > silence
            if stream.bytes ~= "" and (other ~= (direction or 0) or is_silent) then
                split(line, stream, stream.time, true)
            end
        end
        local stream = line.streams[direction or 0]
        if not stream then
            stream = { bytes = "", at = 1, parts = {}, direction = direction }
            line.streams[direction or 0] = stream
        end
        stream.time = time
        stream.bytes = stream.bytes .. bytes
        stream.parts[#stream.parts + 1] = { number = number, offset = 0, size = #bytes }
        split(line, stream, time, false)
    end

    return self
end
