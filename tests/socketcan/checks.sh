#!/bin/sh
# The program and can-utils on the interfaces of the virtual machine: candump and cansend are
# independent of everything that is tested. `checks.sh list` names the checks, `checks.sh NAME` runs
# one; what it prints last is why it failed.
set -u

case $1 in
list)
    sed -n 's/^check_\([a-z0-9_]*\)() .*/\1/p' "$0"
    exit
    ;;
esac

# Results of an earlier check must not be used.
rm -rf "/tmp/$1"
mkdir "/tmp/$1"
cd "/tmp/$1" || exit

running=
trap 'kill $running 2>/dev/null' EXIT

fail() {
    echo "$*" >&2
    exit 1
}

# Waits until a command succeeds.
await() {
    tries=0
    until "$@" 2>/dev/null; do
        tries=$((tries + 1))
        [ $tries -lt 400 ] || fail "waited in vain for: $*"
        sleep 0.05
    done
}

# Fails unless $1 matches the text or the pattern $2.
same() {
    # shellcheck disable=SC2254
    case $1 in
    $2) ;;
    *) fail "this: $1; not: $2" ;;
    esac
}

# Serves motors 1 to 4 on a port.
serve() {
    motorlink sim --rmd "$1" >sim &
    running="$running $!"
    await grep -q '"motors":\[1,2,3,4\]' sim
}

receivers() {
    cat /proc/net/can/rcvlist_* | grep -c raw
}

more_receivers_than() {
    [ "$(receivers)" -gt "$1" ]
}

# Records the traffic of an interface with candump: direction, identifier, bytes.
record() {
    before=$(receivers)
    candump -x "$1" >bus &
    recorder=$!
    running="$running $recorder"
    await more_receivers_than "$before"
}

# The recorded frames in direction $1, received or sent, from the interface's point of view.
recorded() {
    awk -v way="$1" '$2 == way { $1 = $2 = $3 = $4 = $6 = ""; $0 = $0; $1 = $1; print }' bus
}

recorded_lines() {
    [ "$(recorded "$1" | grep -c .)" = "$2" ]
}

# Whether a file has more than $2 lines.
has_grown() {
    [ "$(grep -c . "$1")" -gt "$2" ]
}

rmd() {
    motorlink rmd -p "$port" --timeout 5s "$@"
}

# Without 0x9A and 0x9C, which check a motor and confirm reads. Off and Stop are sent before them
# and repeated.
without_questions() {
    grep -v -E '^14. 9[AC] 00 00 00 00 00 00 00$' | uniq
}

last_is_recorded() {
    recorded RX | grep -q '^160 9A'
}

check_candump_sees_the_bytes_of_the_document() {
    port=socketcan:can0
    serve socketcan:can1
    record can1
    {
        rmd --id 2 pid
        rmd --id 2 pid 1 2 3 4 5 6
        rmd --id 2 pid 1 2 3 4 5 6 --write-rom
        rmd --id 2 acceleration
        rmd --id 2 acceleration 1000
        rmd --id 2 encoder
        rmd --id 2 encoder-offset 100 --write-rom
        rmd --id 2 zero --write-rom
        rmd --id 2 angle
        rmd --id 2 status
        rmd --id 2 clear-errors
        rmd --id 2 torque 16
        rmd --id 2 torque -16
        rmd --id 2 speed -360
        rmd --id 2 stop
        rmd --id 2 run
        rmd --id 2 position 90
        rmd --id 2 position 90 --max-speed 500
        rmd --id 2 single-turn-position 180 ccw --full-turn
        rmd --id 2 single-turn-position 180 cw --max-speed 500 --full-turn
        rmd --id 2 off
        rmd torque4 16 -16 0 8
        rmd --id 4 raw 9C
        rmd scan 3
        # No motor has the last ID.
        motorlink rmd -p $port scan 32 2>/dev/null
    } >/dev/null
    cat >document <<'BYTES'
142 30 00 00 00 00 00 00 00
142 31 00 01 02 03 04 05 06
142 30 00 00 00 00 00 00 00
142 32 00 01 02 03 04 05 06
142 30 00 00 00 00 00 00 00
142 33 00 00 00 00 00 00 00
142 34 00 00 00 E8 03 00 00
142 33 00 00 00 00 00 00 00
142 90 00 00 00 00 00 00 00
142 91 00 00 00 00 00 64 00
142 19 00 00 00 00 00 00 00
142 92 00 00 00 00 00 00 00
142 94 00 00 00 00 00 00 00
142 9D 00 00 00 00 00 00 00
142 92 00 00 00 00 00 00 00
142 94 00 00 00 00 00 00 00
142 9B 00 00 00 00 00 00 00
142 A1 00 00 00 E8 03 00 00
142 A1 00 00 00 18 FC 00 00
142 A2 00 00 00 60 73 FF FF
142 81 00 00 00 00 00 00 00
142 88 00 00 00 00 00 00 00
142 A3 00 00 00 28 23 00 00
142 A4 00 F4 01 28 23 00 00
142 A5 01 00 00 50 46 00 00
142 A6 00 F4 01 50 46 00 00
142 80 00 00 00 00 00 00 00
280 E8 03 18 FC 00 00 F4 01
160 9A 00 00 00 00 00 00 00
BYTES
    await last_is_recorded
    recorded RX | without_questions | diff document - || fail "candump saw other bytes, see above"
}

check_cansend_makes_the_simulated_motors_answer() {
    serve socketcan:can1
    record can0
    cansend can0 142#9A00000000000000
    await recorded_lines RX 1
    # 25 degrees, 24.0 V, no error.
    same "$(recorded RX)" '142 9A 19 00 F0 00 00 00 00'
    # No reply to an unknown command, to a missing motor, or to a frame of another kind.
    cansend can0 142#FF00000000000000
    cansend can0 145#9A00000000000000
    cansend can0 142#9A000000000000
    cansend can0 00000142#9A00000000000000
    cansend can0 142#8000000000000000
    await recorded_lines RX 2
    same "$(recorded RX | tail -n 1)" '142 80 00 00 00 00 00 00 00'
    # Four torques in one frame: the motors answer one after the other.
    cansend can0 280#E80318FC0000F401
    await recorded_lines RX 6
    same "$(recorded RX | tail -n 4 | cut -c 1-6 | tr '\n' ' ')" '141 A1 142 A1 143 A1 144 A1 '
}

# A motor made of candump and cansend: answers requests to ID 5 with $1, and the questions of a new
# host.
scripted_motor() {
    echo "$1" >answer
    [ ! -e scripted ] || return 0
    touch scripted
    before=$(receivers)
    candump -L vcan0,145:7FF | while read -r line; do
        case ${line#*#} in
        9A00000000000000) cansend vcan0 145#9A1900F000000000 ;;
        9C00000000000000) cansend vcan0 145#9C19000000000000 ;;
        9A19* | 9C19* | "$(cat answer)") ;;
        *)
            echo "$line" >asked
            cansend vcan0 "145#$(cat answer)"
            ;;
        esac
    done &
    running="$running $!"
    await more_receivers_than "$before"
}

check_cansend_answers_our_host() {
    port=socketcan:vcan0
    scripted_motor 33000000E8030000
    same "$(rmd --id 5 acceleration --json)" '*"values":{"acceleration":{"value":1000,*'
    same "$(cat asked)" '* vcan0 145#3300000000000000*'
    # The document prints this command's reply with the code of another command.
    scripted_motor 9A1E0000F1000009
    said=$(rmd --id 5 clear-errors --json)
    same "$? $said" '1 {"ok":false,"motor":5,*"values":{"temperature":{"value":30,*'
    same "$(cat asked)" '* vcan0 145#9B00000000000000*'
}

finds_four() {
    [ "$(motorlink rmd -p $port scan "$@" | grep -c V1.62)" = 4 ]
}

check_the_program_finds_and_asks_motors_across_two_cards() {
    port=socketcan:can0
    serve socketcan:can1
    same "$(rmd scan 1 2 3 4 --json | grep -c '"dialect":"V1.62"')" 4
    await finds_four --timeout 100ms
    same "$(rmd --id 3 status --json)" '{"motor":3,*"temperature":{"value":25,"unit":"°C"},"voltage":{"value":24.0,"unit":"V"},*'
    motorlink rmd -p socketcan:can0 --id 9 status 2>silent && fail "motor 9 is not there"
    same "$? $(cat silent)" '*motor 9 does not answer 0x9a*'
}

check_a_watch_goes_on_when_the_interface_is_back() {
    serve socketcan:can1
    motorlink rmd -p socketcan:can0 --timeout 1s angle --every 20ms >watch 2>watch.err &
    running="$running $!"
    await grep -q angle watch
    /sbin/ip link set can0 down
    await grep -q 'the line is lost: CAN interface `can0` is down: sudo ip link set can0 up' watch.err
    before=$(grep -c . watch)
    /sbin/ip link set can0 up
    await grep -q 'the line is back' watch.err
    await has_grown watch "$before"
}

check_a_watch_tells_bus_off_and_goes_on() {
    serve socketcan:vcan0
    motorlink rmd -p socketcan:vcan0 --timeout 1s angle --every 20ms >watch 2>watch.err &
    running="$running $!"
    await grep -q angle watch
    # An error frame of the class bus-off, as a controller's driver sends it.
    cansend vcan0 20000040#0000000000000000
    await grep -q 'the line is lost: `vcan0` is bus-off after too many errors' watch.err
    await grep -q 'the line is back' watch.err
    await has_grown watch "$(grep -c . watch)"
}

check_ports_lists_interfaces_and_its_hints_work() {
    /sbin/ip link set can1 down
    /sbin/ip link set vcan1 down
    motorlink ports >ports
    same "$(grep -c socketcan: ports)" 4
    same "$(grep socketcan:can0 ports)" 'socketcan:can0 * CAN * kvaser_pci * ready'
    same "$(grep socketcan:vcan0 ports)" 'socketcan:vcan0 * CAN * virtual or serial CAN * ready'
    for interface in can1 vcan1; do
        hint=$(sed -n "s/.* down: sudo ip \(link set $interface up.*\)/\1/p" ports)
        # shellcheck disable=SC2086
        /sbin/ip $hint || fail "the hint for $interface does not work: $hint"
    done
    same "$(motorlink ports | grep -c 'socketcan:.* ready')" 4
}

check_sim_says_why_it_cannot_serve_an_interface() {
    /sbin/ip link set can1 down
    said=$(motorlink sim --rmd socketcan:can7 2>&1)
    same "$? $said" '3 *there is no CAN interface `can7`*'
    said=$(motorlink sim --rmd socketcan:can1 2>&1)
    same "$? $said" '3 *CAN interface `can1` is down: sudo ip link set can1 up type can bitrate 1000000*'
    said=$(motorlink sim --st socketcan:can0 2>&1)
    same "$? $said" '2 *`socketcan:can0` cannot be used as a serial line*'
}

check_the_kernels_slcan_driver_works_with_the_simulated_adapter() {
    serve slcan-pty:adapter
    # The driver exists while a program keeps the adapter open: slcan_attach, until a key is
    # pressed.
    sleep 60 | slcan_attach -w -o -s8 -n slcan0 "$(readlink adapter)" &
    running="$running $!"
    await [ -e /sys/class/net/slcan0 ]
    /sbin/ip link set slcan0 up
    port=socketcan:slcan0
    same "$(motorlink ports | grep $port)" 'socketcan:slcan0 * virtual or serial CAN * ready'
    await finds_four 1 2 3 4 --timeout 5s
    rmd --id 2 speed 360 >/dev/null || fail "motor 2 does not answer"
    rmd --id 2 off
    /sbin/ip link set slcan0 down
}

"check_$1"
