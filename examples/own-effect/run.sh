#!/bin/sh
# An effect of your own beside the catalogue's: a small model, then the effect of leaky-bottle.toml, and both beside
# the measurements. run.sh DATASET OUT
set -e
here=$(dirname "$0")
host-fit identify "$1" --n1 1 --n2 1 --n3 1 --delay fixed -o "$2/small.toml"
host-fit extend "$2/small.toml" "$1" --effect-file "$here/leaky-bottle.toml" --effect leaky-bottle -o "$2/extended.toml"
host-fit compare "$2/small.toml" "$2/extended.toml" "$1"
