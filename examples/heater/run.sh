#!/bin/sh
# Another plant than a flow: a heater's log becomes a model in Python. run.sh OUT
set -e
here=$(dirname "$0")
host-fit import "$here"/run.csv -o "$1/heater"
host-fit identify "$1/heater" -o "$1/heater.toml"
host-fit compare "$1/heater.toml" "$1/heater"
host-fit diagnose "$1/heater.toml" "$1/heater"
host-fit codegen "$1/heater.toml" --lang python -o "$1/heater.py"
