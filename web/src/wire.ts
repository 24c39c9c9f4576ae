// Written by `make web-types` from crates/monitor and crates/telemetry.

export type Alive = { 
/**
 * The last [`Text::Beat`] that the page had when it drew the frame.
 */
beat: number, 
/**
 * The number of the last frame that the browser drew.
 */
frame: number, 
/**
 * Whether the key or the finger of hold-to-run is down.
 */
held: boolean, 
/**
 * The page's own clock, in ms. The next beat has it, too.
 */
at: number, };

export type Beat = { 
/**
 * Its number.
 */
beat: number, 
/**
 * The wall clock of the server, in seconds since 1970.
 */
wall: number, 
/**
 * [`Alive::at`] of the last sign of life.
 */
at: number | null, 
/**
 * How long ago that was received, in ms.
 */
since: number, 
/**
 * Whether this page has turned motors, so that its end stops them.
 */
holds: boolean, };

export type Column = { 
/**
 * The name of the register or the quantity.
 */
name: string, 
/**
 * The symbol of the unit; empty without one.
 */
unit: string, };

export type Command = { 
/**
 * Its name in the table.
 */
name: string, 
/**
 * What it does.
 */
doc: string, 
/**
 * Its values.
 */
fields: Array<Field>, 
/**
 * Whether it may move the motor.
 */
moves: boolean, 
/**
 * Whether it wears the ROM of the motor.
 */
wears_rom: boolean, };

export type Condition = "whole" | "cut" | "unreadable";

export type Controlled = { 
/**
 * What.
 */
mode: Mode, 
/**
 * The symbol of the unit.
 */
unit: string, 
/**
 * The signal that measures it.
 */
measured: string, 
/**
 * What the protocol can carry, forwards and backwards.
 */
most: number, };

export type Description = { 
/**
 * The line.
 */
line: string, 
/**
 * What they speak.
 */
protocol: Protocol, 
/**
 * The signals of the overview of a motor.
 */
overview: Overview, 
/**
 * The registers, in the order of the table.
 */
registers: Array<Register>, 
/**
 * The commands.
 */
commands: Array<Command>, 
/**
 * What can be controlled.
 */
modes: Array<Controlled>, 
/**
 * The meaning of the signal `overview.state`.
 */
states: Array<State>, 
/**
 * The bits of the signal `overview.faults`.
 */
faults: Array<Fault>, };

export type Difference = { 
/**
 * Its name.
 */
name: string, 
/**
 * The symbol of the unit; empty without one.
 */
unit: string, 
/**
 * That of the motor.
 */
now: string, 
/**
 * That of the file.
 */
file: string, 
/**
 * Whether writing it wears the ROM of the motor.
 */
wears_rom: boolean, 
/**
 * Why it cannot be written; `null`: it can.
 */
fixed: string | null, };

export type DropRule = "oldest" | "newest";

export type Event = { 
/**
 * When: the wall clock, in seconds since 1970.
 */
wall: number, 
/**
 * The line, unless it is about all.
 */
line?: string | null, 
/**
 * When, by the clock of the line, in seconds.
 */
t?: number | null, 
/**
 * From when on values are doubtful, by the clock of the line, in seconds.
 */
since?: number | null, 
/**
 * The motor, if it is about one.
 */
motor?: number | null, 
/**
 * The program that did it.
 */
by?: string | null, 
/**
 * What happened.
 */
event: EventKind, 
/**
 * The same in words.
 */
message: string, };

export type EventKind = "joined" | "left" | "commanded" | "stopping" | "stopped" | "stop-failed" | "taken" | "latched" | "released" | "lost" | "back" | "silent" | "answers" | "refused" | "doubtful" | "late" | "clock" | "opened" | "closed" | "scanned" | "later";

export type Fault = { 
/**
 * The bit of the signal, from 0.
 */
bit: number, 
/**
 * Its name.
 */
name: string, 
/**
 * Its meaning.
 */
doc: string, 
/**
 * What to do.
 */
advice: string, 
/**
 * Whether the cause is present. Otherwise it has occurred and is not acknowledged.
 */
present: boolean, };

export type Field = { 
/**
 * Its name.
 */
name: string, 
/**
 * Its meaning.
 */
doc: string, 
/**
 * The symbol of the unit; empty without one.
 */
unit: string, 
/**
 * The least and the most value, and the step between values; a step of 0 is any.
 */
range: [number, number, number], 
/**
 * The names of the values 0, 1 and so on; empty for a number.
 */
words: Array<string>, };

export type Finding = "drive" | "refuses" | "garbage" | "foreign" | "echo" | "silence" | "impossible" | "later";

export type FoundPort = { 
/**
 * Its name, as `open` takes it.
 */
port: string, 
/**
 * The protocol of the drives that it can have without an adapter.
 */
protocol: Protocol, 
/**
 * Manufacturer and product.
 */
description?: string | null, 
/**
 * A second path that does not depend on the order in which devices are plugged in.
 */
stable_path?: string | null, 
/**
 * Why it cannot be used now, and what to do.
 */
problem?: string | null, 
/**
 * The line that has it open.
 */
line?: string | null, };

export type FromPage = Alive | Request | ShareRequest;

export type Gap = { 
/**
 * Line and motor, such as `st0/motor1`.
 */
motor: string, 
/**
 * All gaps that are longer than 1 s (at low rates: three periods) together, in seconds.
 */
seconds: number, };

export type Group = { 
/**
 * Its number, which is never used again.
 */
group: number, 
/**
 * Whose it is.
 */
subscription: number, 
/**
 * The line.
 */
line: string, 
/**
 * The motor.
 */
motor: number, 
/**
 * The signals, in the order of the columns after `t` and `span`.
 */
columns: Array<Column>, };

export type Limit = { 
/**
 * Of what.
 */
mode: Mode, 
/**
 * Forwards and backwards, in the unit of the mode, in steps of the protocol.
 */
most: number, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, };

export type Line = { 
/**
 * Its name.
 */
line: string, 
/**
 * `st` or `rmd`.
 */
protocol: Protocol, 
/**
 * The port that the share holds.
 */
port: string, 
/**
 * The profile in which the share reads the frames of an ST drive.
 */
profile?: string | null, 
/**
 * How long the share waits for a reply, in seconds. A stop may take several times as long.
 */
timeout: number, 
/**
 * The line's clock now, in seconds.
 */
t: number, 
/**
 * The wall clock at the same moment, in seconds since 1970.
 */
wall: number, 
/**
 * What its exchanges came to since it was opened. Earlier shares do not say it.
 */
counts?: LineCounts | null, 
/**
 * The motors that have answered since the line was opened.
 */
heard?: Array<number>, 
/**
 * The motors that answered or were turned, and have not confirmed their last stop: it failed or is
 * under way. They may still be turning.
 */
unstopped?: Array<number>, };

export type LineCounts = { 
/**
 * Exchanges that are over.
 */
exchanges: number, 
/**
 * Those in which a drive refused, or answered in a way that was not expected.
 */
refused: number, 
/**
 * Those without a reply.
 */
silent: number, 
/**
 * Those that failed otherwise: damaged replies, echoes, a port that failed.
 */
failed: number, 
/**
 * How often the port was lost.
 */
lost: number, };

export type MeanRate = { 
/**
 * Line and motor, such as `st0/motor1`.
 */
motor: string, 
/**
 * In Hz, since the start of the recording.
 */
rate: number, };

export type Mode = "speed" | "torque" | "position";

export type MotionEnding = "stop" | "off" | "nothing";

export type MotorName = { 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, };

export type Overview = { 
/**
 * The state of an ST motor. RMD motors report none.
 */
state: string | null, 
/**
 * The faults.
 */
faults: string, 
/**
 * The speed.
 */
speed: string, 
/**
 * The current that makes torque.
 */
current: string, 
/**
 * The temperature of the power stage or of the motor.
 */
temperature: string, 
/**
 * The supply.
 */
voltage: string, 
/**
 * The angle over all turns of an RMD motor.
 */
angle: string | null, };

export type Phase = "starting" | "recording" | "ending" | "ended" | "failed";

export type Protocol = "st" | "rmd";

export type Reason = "usage" | "version" | "latched" | "held" | "expired" | "overtaken" | "displaced" | "busy" | "refused" | "silent" | "unheard" | "unconfirmed" | "line" | "forbidden" | "lapsed" | "later";

export type Recorded = { 
/**
 * The name of its file; empty until there is one.
 */
name: string, 
/**
 * How far it is.
 */
phase: Phase, 
/**
 * The page that asked for it.
 */
by: string, 
/**
 * When it was asked for, in seconds since 1970.
 */
began: number, 
/**
 * How long it has recorded, in seconds.
 */
seconds: number, 
/**
 * The size of the file.
 */
bytes: number, 
/**
 * Values in it.
 */
values: number, 
/**
 * Messages that are missing in it, because this machine or the disk was too slow.
 */
lost: number, 
/**
 * Rows that are missing in it, because nothing confirmed them.
 */
unconfirmed: number, 
/**
 * The rate that was asked for, and that of the slowest motor in the last second, in Hz.
 */
rates: [number, number] | null, 
/**
 * The motor with the lowest mean rate since the start.
 */
slowest: MeanRate | null, 
/**
 * Motors that had no values for longer than 1 s.
 */
gaps: Array<Gap>, 
/**
 * Its motors.
 */
motors: Array<string>, 
/**
 * Motors that gave no value yet.
 */
silent: Array<string>, 
/**
 * Signals that the drives do not give.
 */
refused: Array<string>, 
/**
 * Lines on which no motor answered. They are not recorded.
 */
left_out: Array<string>, 
/**
 * Why it failed.
 */
message: string | null, };

export type RecordedEvent = { 
/**
 * When, in seconds from the first message.
 */
t: number, 
/**
 * Whom it concerns: a motor or a line.
 */
of: string, 
/**
 * The kind, one word.
 */
kind: string, 
/**
 * Who commanded it; may be empty.
 */
by: string, 
/**
 * The sentence.
 */
message: string, };

export type RecordedSignal = { 
/**
 * Line and motor, such as `st0/motor1`.
 */
motor: string, 
/**
 * Its name.
 */
name: string, 
/**
 * The symbol of the unit; empty without one.
 */
unit: string, 
/**
 * Its meaning; may be empty.
 */
doc: string, };

export type RecordingContent = { 
/**
 * The name of its file.
 */
name: string, 
/**
 * The time of its first message, in seconds since 1970. Times count from there.
 */
zero: number, 
/**
 * The time of its last message.
 */
seconds: number, 
/**
 * The signals. Their numbers are their places, from 0.
 */
signals: Array<RecordedSignal>, 
/**
 * What is wrong with the file.
 */
damage: string | null, };

export type RecordingFile = { 
/**
 * Its name.
 */
name: string, 
/**
 * Its size.
 */
bytes: number, 
/**
 * When it was written last, in seconds since 1970.
 */
modified: number, 
/**
 * The time of the first message, in seconds since 1970.
 */
began: number | null, 
/**
 * The time from the first to the last message, in seconds.
 */
seconds: number | null, 
/**
 * Its motors.
 */
motors: Array<string>, 
/**
 * Motors that had no values for longer than 1 s, as its end says.
 */
gaps: Array<Gap>, 
/**
 * Whether it is whole.
 */
condition: Condition, 
/**
 * What is wrong with it.
 */
message: string | null, };

export type RecordingPart = { 
/**
 * Where it begins, in seconds from the first message.
 */
from: number, 
/**
 * Where it ends.
 */
to: number, 
/**
 * What happened in this time.
 */
events: Array<RecordedEvent>, 
/**
 * Later events of this time, which are left out.
 */
more_events: number, 
/**
 * What is wrong with the file, as far as it was read.
 */
damage: string | null, };

export type Register = { 
/**
 * Its name.
 */
name: string, 
/**
 * What it belongs to, for headings.
 */
group: string, 
/**
 * Its meaning.
 */
doc: string, 
/**
 * The symbol of the unit; empty without one.
 */
unit: string, 
/**
 * Whether it can be read.
 */
readable: boolean, 
/**
 * Whether it can be written.
 */
writable: boolean, 
/**
 * Whether a write wears the ROM of the motor.
 */
wears_rom: boolean, 
/**
 * Whether a write with `to_rom` makes the value permanent, and wears the ROM. Without it the value holds
 * until the motor loses its supply.
 */
can_keep: boolean, 
/**
 * The least and the most value, and the step between values.
 */
range: [number, number, number] | null, };

export type Request = { 
/**
 * A number of the page's choice.
 */
id: number, } & ({ "ask": "stop-all" } | { "ask": "let-go" } | { "ask": "motors", 
/**
 * The line.
 */
line: string, } | { "ask": "describe", 
/**
 * The line.
 */
line: string, } | { "ask": "read", 
/**
 * The names of the registers.
 */
names: Array<string>, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, } | { "ask": "write", 
/**
 * The name of the register.
 */
name: string, 
/**
 * The value, in the unit of the register.
 */
value: number, 
/**
 * Whether it is allowed to wear the ROM of the motor.
 */
to_rom: boolean, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, } | { "ask": "act", 
/**
 * The name of the command.
 */
command: string, 
/**
 * Its values, in the units of its fields.
 */
values: { [key in string]?: number }, 
/**
 * Hold-to-run: the motor stops as soon as a sign of life says that nothing is held.
 */
hold: boolean, 
/**
 * Whether it is allowed to wear the ROM of the motor.
 */
to_rom?: boolean, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, } | { "ask": "run", 
/**
 * What is controlled.
 */
mode: Mode, 
/**
 * Where the reference ends.
 */
target: number, 
/**
 * How fast it changes, in units of the target a second. Of [`Mode::Position`]: the speed.
 */
rate: number, 
/**
 * As for [`Ask::Act`].
 */
hold: boolean, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, } | { "ask": "limit", 
/**
 * What.
 */
mode: Mode, 
/**
 * The most, forwards and backwards, in the unit of the mode.
 */
most: number | null, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, } | { "ask": "limits" } | { "ask": "dump", 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, } | { "ask": "diff", 
/**
 * The file.
 */
text: string, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, } | { "ask": "restore", 
/**
 * The file.
 */
text: string, 
/**
 * Whether it is allowed to wear the ROM of the motor.
 */
to_rom: boolean, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, } | { "ask": "record", 
/**
 * How often signals are read, in Hz; `null`: 100.
 */
rate: number | null, } | { "ask": "end-recording" } | { "ask": "recordings" } | { "ask": "recording", 
/**
 * The name of its file.
 */
name: string, });

export type Role = "operator" | "viewer";

export type RunResult = { 
/**
 * The last reference that the motor acknowledged, in the unit of the run.
 */
reference: number, 
/**
 * Why it is not the target, and how the motor took the stop that followed.
 */
failure?: string | null, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, };

export type ShareRequest = { 
/**
 * A number of the program's choice.
 */
id: number, 
/**
 * How long ago it was made at most, in seconds, if another program passes it on.
 */
age?: number | null, } & ({ "ask": "hello", 
/**
 * The version of the messages.
 */
protocol: number, 
/**
 * Who it is, for the log.
 */
name: string, } | { "ask": "lines" } | { "ask": "signals", 
/**
 * The line.
 */
line: string, } | { "ask": "subscribe", 
/**
 * The signals.
 */
signals: Array<SignalName>, 
/**
 * The time between two values, in seconds.
 */
period: number, 
/**
 * How many records wait at most for this program.
 */
queue: number, 
/**
 * What is lost when more would wait.
 */
drop: DropRule, 
/**
 * Whether the signals of a motor are one group, whose rows are sent once they are confirmed.
 */
rows?: boolean, } | { "ask": "unsubscribe", 
/**
 * The subscription.
 */
subscription: number, } | { "ask": "command", 
/**
 * The line.
 */
line: string, 
/**
 * The motor.
 */
motor: number, 
/**
 * ST: frame code and payload, without motor, length and checksum. RMD: the eight bytes.
 */
bytes: Array<number>, 
/**
 * The time to live in seconds: it is not sent later.
 */
time_to_live: number, 
/**
 * Whether it is sent only if nothing has stopped the motor, and no other program has moved it,
 * since the program's last command to it without this.
 */
continues?: boolean, 
/**
 * Whether it is refused with `held` unless the program owns the motor. For automatic stops, such as
 * those at the end of a program.
 */
own?: boolean, } | { "ask": "confirm", 
/**
 * The line.
 */
line: string, 
/**
 * The motor.
 */
motor: number, } | { "ask": "stop", 
/**
 * The motor; all motors that the lines can have, without it.
 */
motor?: MotorName | null, } | { "ask": "ending", 
/**
 * What is done.
 */
motion: MotionEnding, } | { "ask": "deadline", 
/**
 * Nothing came from the program for longer than this, in seconds.
 */
silence?: number | null, 
/**
 * A motor that it moves got no new command for longer than this, in seconds.
 */
motion?: number | null, } | { "ask": "alive" } | { "ask": "take", 
/**
 * The motor.
 */
motor: MotorName, } | { "ask": "claim", 
/**
 * The motor.
 */
motor: MotorName, } | { "ask": "latch" } | { "ask": "release" } | { "ask": "rates", 
/**
 * The line; all lines, without it.
 */
line?: string | null, } | { "ask": "ports" } | { "ask": "scan", 
/**
 * The port, as `open` takes it.
 */
port: string, 
/**
 * What its drives may speak.
 */
protocol: Protocol, 
/**
 * The rate: baud of a serial line, bit/s of a CAN bus. That of the port's name without it.
 */
rate?: number | null, 
/**
 * How long to wait for each reply, in seconds; a short time without it.
 */
timeout?: number | null, } | { "ask": "open", 
/**
 * The port, as `-p` takes it: a device, a CAN interface, an adapter or a TCP address.
 */
port: string, 
/**
 * What its drives speak.
 */
protocol: Protocol, 
/**
 * The profile of ST drives; the document's without it.
 */
profile?: string | null, 
/**
 * How long to wait for a reply, in seconds; that of the protocol without it.
 */
timeout?: number | null, } | { "ask": "close", 
/**
 * The line.
 */
line: string, } | { "ask": "frames", 
/**
 * The line.
 */
line: string, 
/**
 * Not before this time of the line's clock, in seconds.
 */
from?: number | null, 
/**
 * Not after this time of the line's clock, in seconds.
 */
to?: number | null, 
/**
 * Only those after the frame with this number.
 */
after?: number | null, 
/**
 * How many at most.
 */
most: number, } | { "ask": "leave", 
/**
 * The reason, for the log.
 */
why: string, });

export type ShareText = { "kind": "answer", 
/**
 * That of the request.
 */
id: number, } & ({ "to": "hello", 
/**
 * The version of the messages.
 */
protocol: number, 
/**
 * The name of the program at the other end, with its version.
 */
share: string, 
/**
 * The name that the log has for this program. Others may have the same.
 */
name: string, } | { "to": "lines", 
/**
 * All lines.
 */
lines: Array<Line>, 
/**
 * Who stopped the motors, if motion is refused.
 */
latched_by?: string | null, } | { "to": "signals", 
/**
 * All signals of a motor.
 */
signals: Array<Column>, } | { "to": "subscribe", 
/**
 * Its number.
 */
subscription: number, } | { "to": "unsubscribe" } | { "to": "command", 
/**
 * ST: the payload of the reply. RMD: the eight bytes.
 */
bytes: Array<number>, } | { "to": "confirm" } | { "to": "stop", 
/**
 * The motors and how they took it.
 */
motors: Array<StoppedMotor>, } | { "to": "claim" } | { "to": "deadline" } | { "to": "ending" } | { "to": "take" } | { "to": "latch" } | { "to": "release" } | { "to": "rates", 
/**
 * Those of the signals that are read.
 */
rates: Array<SignalRate>, } | { "to": "ports", 
/**
 * Those that can be found without opening them.
 */
ports: Array<FoundPort>, } | { "to": "scan", 
/**
 * The port at this rate, as `open` takes it.
 */
port: string, 
/**
 * The rate. Missing if the port cannot choose it.
 */
rate?: number | null, 
/**
 * What answered.
 */
finding: Finding, 
/**
 * The same in words.
 */
text: string, 
/**
 * The IDs of the RMD motors that replied.
 */
motors?: Array<number>, 
/**
 * The rates that the port can choose, the most frequent first.
 */
rates: Array<number>, } | { "to": "open", 
/**
 * The name of the new line.
 */
line: string, } | { "to": "close", 
/**
 * The motors that were stopped, and how they took it.
 */
motors: Array<StoppedMotor>, } | { "to": "frames", 
/**
 * In the order in which they were seen.
 */
frames: Array<WireFrame>, 
/**
 * More such frames are kept: those after the last one of these.
 */
more: boolean, 
/**
 * Frames after the one that was named are forgotten.
 */
missed: boolean, 
/**
 * When the oldest frame that is kept was seen, by the clock of the line, in seconds.
 */
kept_since?: number | null, 
/**
 * What the line carried from the first one of these frames to the last.
 */
load: WireLoad, }) | { "kind": "refusal", 
/**
 * That of the request.
 */
id: number, 
/**
 * The reason, for programs.
 */
reason: Reason, 
/**
 * The reason as a sentence.
 */
message: string, 
/**
 * The error code of an ST drive that refused.
 */
code?: number | null, } | { "kind": "group" } & Group | { "kind": "unconfirmed", 
/**
 * The subscription.
 */
subscription: number, 
/**
 * The line.
 */
line: string, 
/**
 * The motor.
 */
motor: number, 
/**
 * How many.
 */
rows: number, } | { "kind": "event" } & Event | { "kind": "missed", 
/**
 * How many.
 */
events: number, } | { "kind": "closing", 
/**
 * Why, in words.
 */
message: string, } | { "kind": "later" };

export type SignalName = { 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, 
/**
 * The name of the register or the quantity.
 */
name: string, };

export type SignalRate = { 
/**
 * The shortest period that a program asked for, in seconds.
 */
asked: number, 
/**
 * The period that the line carries, in seconds.
 */
predicted: number, 
/**
 * Values in the last second.
 */
achieved: number, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, 
/**
 * The name of the register or the quantity.
 */
name: string, };

export type State = { 
/**
 * The value of the signal.
 */
value: number, 
/**
 * Its name.
 */
name: string, 
/**
 * Its meaning.
 */
doc: string, };

export type StoppedMotor = { 
/**
 * Why the stop was not confirmed; without it the drive confirmed it. The motor may still be turning,
 * unless `absent`.
 */
failure?: string | null, 
/**
 * No motor was found there: the drive says that it has none, or nothing has ever answered and no
 * program commanded it to move.
 */
absent?: boolean, 
/**
 * The line.
 */
line: string, 
/**
 * The motor's number or ID.
 */
motor: number, };

export type Text = { "kind": "welcome" } & Welcome | { "kind": "beat" } & Beat | { "kind": "answer", 
/**
 * That of the request.
 */
id: number, } & ({ "to": "stop-all", 
/**
 * The motors and how they took it.
 */
motors: Array<StoppedMotor>, } | { "to": "let-go" } | { "to": "motors", 
/**
 * Their numbers or IDs.
 */
motors: Array<number>, } | { "to": "describe" } & Description | { "to": "read", 
/**
 * In the order of the names.
 */
values: Array<Value>, } | { "to": "write", 
/**
 * What was read back: the register, and others that the same request writes.
 */
values: Array<Value>, } | { "to": "act", 
/**
 * The values of the reply, by field.
 */
values: Array<Value>, } | { "to": "run", 
/**
 * The first reference: the measured value, or the limit if that is less.
 */
from: number, 
/**
 * Whether the server sends the next references, and says by [`Text::Ran`] when they end.
 * Otherwise the drive goes to the target on its own.
 */
streams: boolean, } | { "to": "limit" } | { "to": "limits", 
/**
 * Those of all motors.
 */
limits: Array<Limit>, } | { "to": "dump", 
/**
 * The file.
 */
text: string, 
/**
 * Its usual name.
 */
file: string, 
/**
 * What the motor refused to give.
 */
warnings: Array<string>, } | { "to": "diff", 
/**
 * What differs.
 */
differences: Array<Difference>, } | { "to": "restore", 
/**
 * What was written and read back.
 */
written: Array<Difference>, } | { "to": "record", 
/**
 * The name of its file.
 */
name: string, } | { "to": "end-recording", 
/**
 * The recording.
 */
recording: Recorded, } | { "to": "recordings", 
/**
 * Their folder.
 */
folder: string, 
/**
 * The newest first, without the one that is made.
 */
recordings: Array<RecordingFile>, 
/**
 * Older ones that are not listed.
 */
older: number, } | { "to": "recording" } & RecordingContent) | { "kind": "lapsed", 
/**
 * Why, in words.
 */
message: string, } | { "kind": "ran" } & RunResult | { "kind": "share", 
/**
 * Why it is lost; `null`: it is there.
 */
lost: string | null, } | { "kind": "recorded" } & Recorded;

export type Value = { 
/**
 * The register or the field.
 */
name: string, 
/**
 * In its unit; `null`: there is none, or the drive gives one that is not possible, and `text` says why.
 */
value: number | null, 
/**
 * As text: a state, faults, a version, or the value with its decimals. Without a value: why.
 */
text: string, 
/**
 * The symbol of the unit; empty without one.
 */
unit: string, };

export type Welcome = { 
/**
 * The program and its version.
 */
server: string, 
/**
 * The name of this page in events.
 */
name: string, 
/**
 * What it may do.
 */
role: Role, 
/**
 * How long a page may give no sign of life until its motors stop, in ms.
 */
deadline: number, 
/**
 * Whether the share is another process. It stops the motors of the pages if the server is killed.
 */
separate_share: boolean, 
/**
 * Which run of the server it is. Another one knows nothing of the page's subscriptions and motors.
 */
run: string, };

export type WireFrame = { 
/**
 * Its number on this line. Later frames have greater ones.
 */
number: number, 
/**
 * When it was sent, or its last byte came: by the clock of the line, in seconds.
 */
t: number, 
/**
 * Its direction.
 */
direction: WireWay, 
/**
 * What it is.
 */
result: WireResult, 
/**
 * The identifier of a CAN frame.
 */
id?: number | null, 
/**
 * The bytes on a serial line, or the data of a CAN frame, in hexadecimal.
 */
bytes: string, 
/**
 * What it means, or why it is not a frame.
 */
words: string, 
/**
 * The motor, if it is known.
 */
motor?: number | null, 
/**
 * Whether it repeats a request that got no reply.
 */
retry?: boolean, 
/**
 * Whether it is a request that got no reply.
 */
unanswered?: boolean, };

export type WireLoad = { 
/**
 * When it begins, by the clock of the line, in seconds. Missing without frames.
 */
from?: number | null, 
/**
 * When it ends.
 */
to?: number | null, 
/**
 * Bits on the wire: 10 a byte on a serial line. On a CAN bus without stuffed bits.
 */
bits: number, 
/**
 * The part of the time in which a reply was awaited, 0 to 1.
 */
busy: number, 
/**
 * Requests that the drive refused.
 */
nacks: number, 
/**
 * Bytes that are no frame.
 */
damaged: number, 
/**
 * Requests that were sent again.
 */
retries: number, 
/**
 * Requests without a reply.
 */
unanswered: number, };

export type WireResult = "ok" | "nack" | "damaged" | "foreign" | "later";

export type WireWay = "to-drive" | "from-drive";
