# The package /darm.deb in a clean Debian 12, as a user has it. Runs as root in the root that `clean_root.rs` makes.
set -eu
step() { echo "check: $*"; }
fail() { echo "check FAILED: $*" >&2; exit 1; }
# Waits until a file has a line that begins with $2.
wait_for() {
    for _ in $(seq 100); do
        if grep -q "^$2" "$1"; then return; fi
        sleep 0.1
    done
    cat "$1" >&2
    fail "no line '$2' in $1"
}
# Ends the process of a server as Ctrl-C does.
end() {
    kill -INT "$1"
    wait "$1" || fail "a server ended with exit code $?"
}
export DEBIAN_FRONTEND=noninteractive

step "no toolchain and no source tree"
for program in cargo rustc rustup cc gcc qemu-system-arm; do
    if command -v $program > /dev/null; then fail "$program is installed"; fi
done

step "install"
dpkg --get-selections | sort > /before
apt-get -qq update
apt-get -qq install -y --no-install-recommends /darm.deb > /dev/null 2> /install.log || { cat /install.log; fail "apt-get"; }
dpkg --get-selections | sort | comm -13 /before - | sed 's/^/check: installed /'
for file in /usr/bin/darm /usr/share/man/man1/darm-synth.1.gz /usr/lib/udev/rules.d/60-darm.rules \
    /usr/share/bash-completion/completions/darm /usr/share/zsh/vendor-completions/_darm \
    /usr/share/fish/vendor_completions.d/darm.fish /usr/share/doc/darm/copyright /usr/share/doc/darm/README.md \
    /usr/share/doc/darm/docs/first-arm.md \
    /usr/share/doc/darm/THIRD-PARTY.md /usr/share/doc/darm/rust-std.COPYRIGHT.html /usr/share/doc/darm/examples/planar4.toml; do
    [ -f $file ] || fail "no $file"
done
notice=/usr/share/doc/darm/THIRD-PARTY.md
grep -q '^- serialport .* Mozilla Public License 2.0' $notice || fail "$notice does not say where the source of serialport is"
zcat /usr/share/man/man1/darm-synth.1.gz | grep -q '^.SH NAME' || fail "darm-synth.1.gz is no manual page"
# The shell calls the function so when somebody types `darm sy` and the tab key.
words=$(bash -c '. /usr/share/bash-completion/completions/darm
    COMP_WORDS=(darm sy) COMP_CWORD=1; _darm darm sy darm; echo "${COMPREPLY[*]}"')
[ "$words" = synth ] || fail "darm sy<tab> completes to: $words"

mkdir /work
cd /work
cp /usr/share/doc/darm/examples/* .

# Simulator, upload, play and live page; $1: what has to be in the description of the board.
use() {
    darm sim planar4.toml > sim.log 2>&1 &
    simulator=$!
    wait_for sim.log "camera "
    sed 's/^/  /' sim.log
    grep -q "^board .*$1" sim.log || fail "the board is not: $1"
    darm table planar4.toml --words 000,000,000,000 111,000,111,000 -o two.darm
    darm upload two.darm
    darm play two.darm
    darm status
    darm serve planar4.toml --listen 127.0.0.1:0 > serve.log 2>&1 &
    server=$!
    wait_for serve.log "page "
    page=$(grep --only-matching 'http://[^ ]*' serve.log | head --lines 1)
    curl --silent --show-error --fail "$page" | grep --only-matching '<title>[^<]*</title>'
    curl --silent --show-error --fail "${page}vendor/three.module.min.js" | wc -c
    end $server
    darm doctor
    end $simulator
}

step "sim, upload, play, serve, doctor; the firmware's library in the process"
use "library in this process"

step "doctor alone"
darm doctor | tee doctor.log
grep -q "^good .*images of b-l475e-iot01a, pico, olimex-stm32-h405 in this program" doctor.log || fail "no images"
grep -q "^good .*60-darm.rules" doctor.log || fail "no udev rule"

step "the embedded image of the Pico, to a boot drive"
mkdir drive
echo "Board-ID: RPI-RP2" > drive/INFO_UF2.TXT
darm flash --board pico --drive drive
[ -s drive/darm.uf2 ] || fail "no image on the drive"

step "diagnosis"
darm diagnose planar4.toml planar4-run.csv -o arm-2.toml | head -2

step "the embedded image in the emulator"
echo "deb http://deb.debian.org/debian bookworm-backports main" > /etc/apt/sources.list.d/backports.list
apt-get -qq update
apt-get -qq install -y --no-install-recommends -t bookworm-backports qemu-system-arm > /dev/null
use "images/b-l475e-iot01a-.*elf in qemu-system-arm"

step "remove"
apt-get -qq purge -y darm > /dev/null
left=$(find / -xdev -path /proc -prune -o -path /root -prune -o -path /work -prune -o -name '*darm*' -print | grep -v '^/darm.deb$' || true)
[ -z "$left" ] || fail "left behind: $left"
step "passed"
