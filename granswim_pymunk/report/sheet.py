"""The style sheet of the page: one column, light and dark, readable on a phone and printed."""

STYLE_SHEET = """
:root { color-scheme: light dark; --paper: #ffffff; --ink: #1d1d1f; --soft: #5c5f66; --line: #dcdfe4;
  --tint: #f3f5f8;
  --naive: #d55e00; --recalibrated: #e69f00; --revised: #0072b2; --floor: #777777; --link: #00598c; }
@media screen and (prefers-color-scheme: dark) {
  :root { --paper: #141414; --ink: #e8e8ea; --soft: #a3a7ae; --line: #34373c; --tint: #1e2024; --link:
  #7cc4f0;
    --revised: #4aa8e0; --naive: #f0843a; }
  figure img { filter: invert(0.92) hue-rotate(180deg); } }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 1.0625rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "Noto Sans",
  sans-serif; }
main { max-width: 46rem; margin: 0 auto; padding: 2.5rem 1.1rem 4rem; }
.kicker { color: var(--soft); font-size: .85rem; margin: 0 0 .4rem; overflow-wrap: anywhere; }
h1 { font-size: clamp(1.5rem, 5.2vw, 2.15rem); line-height: 1.2; letter-spacing: -.012em; margin: 0 0
  1rem; text-wrap: balance; }
h2 { font-size: 1.25rem; margin: 2.8rem 0 .6rem; letter-spacing: -.005em; }
h3 { font-size: 1rem; margin: 1.6rem 0 .3rem; }
p { margin: .6rem 0; }
a { color: var(--link); }
a.word { color: inherit; text-decoration: underline dotted var(--soft); text-underline-offset: .18em; }
dt { font-weight: 600; font-size: .92rem; margin-top: .7rem; } dt:target { background: var(--tint); }
dd { margin: .1rem 0 0; font-size: .92rem; }
.law { background: var(--tint); border-left: 3px solid var(--revised); padding: .8rem 1.1rem; margin:
  1.1rem 0; border-radius: 0 6px 6px 0; }
.law p { margin: .15rem 0; }
.equation { font: italic 1.2rem/1.5 "STIX Two Text", "Cambria", Georgia, "Times New Roman", serif;
  overflow-wrap: anywhere; }
.equation sub, .equation sup { font-size: .72em; line-height: 0; }
.values { font-variant-numeric: tabular-nums; }
.ci, .who, .note, figcaption { color: var(--soft); }
.who, .note, figcaption { font-size: .88rem; line-height: 1.45; }
.who { overflow-wrap: anywhere; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; line-height: 1.4; margin: .6rem 0;
  font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; color: var(--soft); font-size: .82rem; vertical-align: bottom; }
th, td { padding: .38rem .9rem .38rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
th:last-child, td:last-child { padding-right: 0; }
.n { text-align: right; white-space: nowrap; }
th.n { white-space: normal; }
.tight td { white-space: nowrap; } .tight td:first-child { white-space: normal; }
.errors td { font-size: 1rem; }
.dot { display: inline-block; width: .62rem; height: .62rem; border-radius: 50%; margin-right: .5rem; }
.dot.naive { background: var(--naive); } .dot.recalibrated { background: var(--recalibrated); }
.dot.revised { background: var(--revised); } .dot.floor { background: var(--floor); }
figure { margin: 1.3rem 0 1.8rem; }
figure img { display: block; width: 100%; height: auto; min-width: 30rem; }
figcaption { margin-top: .5rem; }
.film canvas { display: block; width: 100%; touch-action: pan-y; }
.film .play { display: flex; gap: .6rem; align-items: center; flex-wrap: wrap; margin-top: .3rem; }
.film button { font: inherit; width: 2.4rem; padding: .1rem 0; color: var(--ink); background: var(--tint);
  border: 1px solid var(--line); border-radius: 5px; }
.film input { flex: 1 1 10rem; accent-color: var(--revised); border-radius: 4px; }
.film output { flex: 1 0 100%; font-size: .88rem; color: var(--soft); font-variant-numeric: tabular-nums; }
@media screen and (max-width: 36rem) {
  .n { white-space: normal; }
  .cards thead { display: none; } .cards tr { display: block; border-bottom: 1px solid var(--line); padding: .4rem 0; }
  .cards td, .tight td { display: grid; grid-template-columns: 8.5rem 1fr; border: 0; padding: .1rem 0;
    text-align: left; white-space: normal; }
  .cards td::before { content: attr(data-name); color: var(--soft); font-size: .82rem; }
  figure .scroll::before { content: "\\2190  swipe the picture  \\2192"; position: sticky; left: 0; color: var(--soft);
    font-size: .8rem; } }
@media print { .film { display: none; } }
sub, sup { line-height: 0; }
ul { padding-left: 1.1rem; margin: .5rem 0; }
@media print { main { max-width: none; padding: 0; } body { font-size: 10.5pt; } figure img { min-width:
  0; max-width: 16cm; }
  figure, tr, .law { break-inside: avoid; }
  .scroll { overflow: visible; } table { font-size: 8.5pt; } h2, h3 { break-after: avoid; }
  a { color: inherit;
  text-decoration: none; }
  .law { print-color-adjust: exact; -webkit-print-color-adjust: exact; } .dot { print-color-adjust:
  exact; -webkit-print-color-adjust: exact; } }
@page { margin: 1.8cm; }
"""
