#!/usr/bin/env bash
# VPLs against paths at full size: see README.md.
set -euo pipefail
cd "$(dirname "$0")/../.."

cargo build -p master -p worker
echo "| Scene | Size | VPLs | Light samples | Paths | Mean | Blocks within 3 % | 95 % of blocks within | VPLs took | Paths took |"
echo "| --- | --- | --: | --: | --: | --: | --: | --: | --: | --: |"
cargo test -p gridlight --test light -- --ignored --nocapture | grep '^|'
