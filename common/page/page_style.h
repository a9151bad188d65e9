// The style of all reports that are pages.
#pragma once

namespace silhouette {

inline constexpr char kPageStyle[] = R"(
:root { --good: #1b8a5a; --fair: #d99000; --bad: #c8420f; --unknown: #a9b0b8; --ink: #20262d;
  --soft: #5d6873; --line: #dfe4e8; }
* { box-sizing: border-box; }
body { margin: 0; background: #f4f6f8; color: var(--ink);
  font: 15px/1.45 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
main { max-width: 1240px; margin: 0 auto; padding: 28px 28px 60px; }
h1 { margin: 0 0 2px; font-size: 27px; font-weight: 650; }
h2 { margin: 34px 0 4px; font-size: 19px; font-weight: 650; }
h3 { margin: 0; font-size: 16px; font-weight: 650; }
p { margin: 4px 0 10px; }
.soft, .origin { color: var(--soft); }
.origin { font-size: 13px; overflow-wrap: anywhere; }
.origin span { margin-right: 18px; }
.verdict { margin: 18px 0; padding: 14px 18px; border-radius: 8px; background: #fff;
  border: 1px solid var(--line); border-left: 8px solid var(--good); }
.verdict.fair { border-left-color: var(--fair); } .verdict.bad { border-left-color: var(--bad); }
.verdict strong { font-size: 18px; }
.verdict ul { margin: 8px 0 0; padding-left: 20px; } .verdict li { margin: 4px 0; }
.tiles { display: grid; grid-template-columns: repeat(5, 1fr); gap: 12px; }
.tile { background: #fff; border: 1px solid var(--line); border-top: 4px solid var(--unknown);
  border-radius: 8px; padding: 10px 14px 12px; }
.tile.good { border-top-color: var(--good); } .tile.fair { border-top-color: var(--fair); }
.tile.bad { border-top-color: var(--bad); }
.tile .name { font-size: 13px; color: var(--soft); }
.tile .value { font-size: 25px; font-weight: 650; white-space: nowrap; }
.tile .value small { font-size: 15px; font-weight: 450; }
.tile .more { font-size: 13px; color: var(--soft); }
.card { background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: 14px 18px;
  margin: 12px 0; overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 14px; }
th { text-align: right; font-weight: 500; color: var(--soft); padding: 4px 10px; font-size: 13px;
  vertical-align: bottom; border-bottom: 1px solid var(--line); }
td { text-align: right; padding: 6px 10px; border-bottom: 1px solid #eef1f3; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
tr:last-child td { border-bottom: 0; }
th:first-child, td:first-child { text-align: left; }
td small { color: var(--soft); }
table.narrow { width: auto; }
.dot { display: inline-block; width: 9px; height: 9px; border-radius: 50%; margin-right: 6px;
  background: var(--unknown); }
.dot.good { background: var(--good); } .dot.fair { background: var(--fair); }
.dot.bad { background: var(--bad); }
.maps { display: grid; grid-template-columns: repeat(3, 1fr); gap: 22px; margin-top: 10px; }
figure { margin: 0; } figcaption { font-size: 13px; color: var(--soft); margin-bottom: 5px; }
svg { display: block; width: 100%; font: 12px system-ui, "DejaVu Sans", sans-serif; }
svg text { fill: var(--soft); } svg .right { text-anchor: end; }
svg .field { fill: #fbfcfd; } svg .frame { fill: none; stroke: #b9c1c9; }
svg .missed { fill: #f3d9a4; }
.arrows path { stroke: #0060a0; stroke-width: 0.9; fill: none; } .arrows circle { fill: #0060a0; }
.arrows path.out { stroke: var(--bad); stroke-width: 1.6; } .arrows circle.out { fill: var(--bad); }
svg .bar { stroke: var(--ink); stroke-width: 2; }
.images rect.good { fill: #9fd3ba; } .images rect.fair { fill: #f0c568; }
.images rect.bad { fill: #e58a63; } .images rect.unknown { fill: #d5dade; }
.images .mark { fill: var(--ink); }
.key span { margin-right: 18px; font-size: 13px; color: var(--soft); }
.key i { display: inline-block; width: 12px; height: 12px; margin-right: 5px; vertical-align: -1px; }
dl { margin: 0; } dt { font-weight: 600; margin-top: 8px; } dd { margin: 0; color: var(--soft); }
@media (max-width: 900px) { .tiles { grid-template-columns: repeat(2, 1fr); }
  .maps { grid-template-columns: 1fr; } }
)";

}  // namespace silhouette
