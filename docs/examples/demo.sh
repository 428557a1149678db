#!/usr/bin/env bash
# From particles to a leaderboard row in about five minutes on two cores: `make demo`, or
# demo.sh [FOLDER] if GranBench is installed. Every line of the output that begins with $ is a
# command that can be typed by hand. Run it again to continue after an interruption.
set -euo pipefail
out=${1:-demo-out}
minutes=${TRAINING_MINUTES:-3}
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
board=leaderboard/submissions/dem-triaxial

if [ -t 1 ]; then bold=$'\e[1m' plain=$'\e[0m'; else bold= plain=; fi
title() { printf '\n%s%s%s\n' "$bold" "$1" "$plain"; }
run() {
  printf '$ %s\n' "$*"
  "$@"
}
mkdir -p "$out/pictures"

title "1. New tests on two small packings with the discrete element method (DEM)"
if command -v liggghts >/dev/null; then
  run granbench generate dem-triaxial --preset smoke --out "$out/fresh" --workers 2
  specimen=$(ls -d "$out"/fresh/campaign/results/specimen* | head -n 1)
  python docs/examples/packing_picture.py "$specimen" "$out/pictures/packing.png" >"$out/fresh/picture.log"
else
  echo "LIGGGHTS is not installed, so no new tests are made; everything below works without it."
fi

title "2. The dataset dem-triaxial: fetch and verify it"
run granbench data fetch dem-triaxial --dest "$out"
run granbench data verify "$out"/dem-triaxial-*.nc
run granbench data info dem-triaxial

title "3. A long short-term memory network with the initial state as input (mLSTM), trained for $minutes minutes"
# Another seed than the models of the board: the board refuses a second copy of a model.
run granbench train mlstm --task dem-triaxial --seed 7 --budget "$minutes" --out "$out/mlstm"

title "4. Its scores, compared with the network without that input (LSTM) and two simple models"
run granbench evaluate "$out/mlstm" --task dem-triaxial --name mlstm-demo \
  --against "$board/lstm.json" --against "$board/linear-elastic.json" \
  --against "$board/persistence.json" --out "$out/submission.json"
run granbench submission validate "$out/submission.json"

title "5. The leaderboard with the new row"
run granbench leaderboard build --with "$out/submission.json" --out "$out/leaderboard"

title "6. Pictures"
run python docs/examples/prediction_pictures.py "$out/pictures" "$out/submission.json" \
  "$board/lstm.json"
printf '\nThe leaderboard: %s\nThe pictures:\n' "$out/leaderboard/index.html"
ls "$out"/pictures/*.png
