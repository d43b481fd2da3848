#!/usr/bin/env bash
# VPLs against paths at full size: see README.md.
set -euo pipefail
cd "$(dirname "$0")/../.."

cargo build -p master -p worker
echo "| Scene | Size | VPLs | Light samples | Paths | Mean | Blocks within 3 % | 95 % of blocks within | VPLs took | Paths took |"
echo "| --- | --- | --: | --: | --: | --: | --: | --: | --: | --: |"
GRIDLIGHT_PATHS=${GRIDLIGHT_PATHS:-4096} \
    cargo test -p gridlight --test light -- --nocapture the_light_is_right_at_full_size | grep '^|'
