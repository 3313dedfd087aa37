"""How a page looks: on wide and narrow screens, light, dark and on paper."""

STYLE = """
:root { color-scheme: light dark; --ink: #1c1d1f; --soft: #63666b; --line: #d9dbde; --paper: #fff;
  --tint: #f5f6f7; --mark: #0072b2; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e5e7; --soft: #9da1a7; --line: #3a3d42; --paper: #17181a; --tint: #212327;
    --mark: #5aa9e6; } }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: var(--paper);
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", "Noto Sans", "DejaVu Sans", sans-serif; }
main { max-width: 58rem; margin: 0 auto; padding: 3.5rem 1.5rem 5rem; }
header { padding-bottom: 1.25rem; border-bottom: 1px solid var(--line); }
h1 { margin: 0; font-size: 2rem; line-height: 1.2; font-weight: 600; letter-spacing: -0.015em; }
h2 { margin: 3rem 0 0.75rem; font-size: 1.25rem; line-height: 1.3; font-weight: 600; }
p { max-width: 42rem; margin: 0.75rem 0; }
header p { margin: 0.4rem 0 0; color: var(--soft); }
h1, h2, p, figcaption, td, th, dd { overflow-wrap: break-word; }
caption, figcaption { color: var(--soft); font-size: 0.875rem; line-height: 1.45; }
.scroll { overflow-x: auto; margin: 1.5rem 0; }
table { border-collapse: collapse; font-size: 0.9375rem; font-variant-numeric: tabular-nums; }
caption { padding-bottom: 0.5rem; text-align: left; }
th, td { padding: 0.4rem 1.5rem 0.4rem 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); }
thead th { font-size: 0.875rem; font-weight: 600; vertical-align: bottom;
  border-bottom-color: var(--soft); }
tbody th { font-weight: 400; }
.number { padding: 0.4rem 0 0.4rem 1.5rem; text-align: right; white-space: nowrap; }
tr > .number:first-child { padding-left: 0; }
.number + :not(.number) { padding-left: 1.5rem; }
figure { margin: 1.75rem 0; }
img { display: block; max-width: 100%; height: auto; }
figcaption { max-width: 42rem; margin-top: 0.5rem; }
.card { background: #fff; }
.coarse { image-rendering: pixelated; }
details { margin: 1.25rem 0; }
summary { cursor: pointer; color: var(--soft); }

.panels { display: grid; grid-template-columns: repeat(var(--columns), minmax(0, 1fr));
  gap: 1.25rem; }
.title { margin: 0.35rem 0 0; color: var(--soft); font-size: 0.875rem; }
.panel .stage, .slider .stage { position: relative; }
.panel img, .pair { width: min(100%, 34rem * var(--w) / var(--h)); }
.frames { display: flex; overflow-x: auto; scroll-snap-type: x mandatory; gap: 0.5rem; }
.frames img { flex: none; scroll-snap-align: start; width: min(100%, 36rem * var(--w) / var(--h)); }
.pair { display: grid; grid-template-columns: 1fr 1fr; gap: 0.25rem 0.5rem; }
.pair img { width: 100%; }
.pair span { font-size: 0.8125rem; }
.choice, .pair input { display: none; }
output { font-variant-numeric: tabular-nums; }
.live .frames { display: block; }
.live .frames img:not(.shown) { display: none; }
.live .choice { display: block; margin-top: 0.5rem; }
.choice input { width: min(32rem, 65%); vertical-align: middle; }
.live .pair { grid-template-columns: 1fr; position: relative; overflow: hidden; --at: 50%; }
.live .pair img { grid-area: 1 / 1; }
.live .after { clip-path: inset(0 0 0 var(--at)); }
.live .pair::after { content: ""; position: absolute; inset: 0 auto 0 var(--at); width: 2px;
  margin-left: -1px; background: #fff; box-shadow: 0 0 0 1px #0008; pointer-events: none; }
.live .pair input { display: block; position: absolute; inset: 0; width: 100%; height: 100%;
  margin: 0; opacity: 0; cursor: ew-resize; touch-action: pan-y; }
.live .pair span { position: absolute; bottom: 0; left: 0; padding: 0.1rem 0.5rem; color: #fff;
  background: #000a; }
.live .pair span + span { left: auto; right: 0; }
.pair:focus-within, .frames:focus-visible { outline: 2px solid var(--mark); outline-offset: 2px; }

.zoom { position: absolute; opacity: 0; width: 1px; height: 1px; margin: 0; }
.zoom:focus-visible + .stage { outline: 2px solid var(--mark); outline-offset: 3px; }
.stage > label:not(.choice) { display: block; cursor: zoom-in; }
.stage > .corner { position: absolute; top: 0.35rem; left: 0.35rem; width: 2rem; height: 2rem;
  text-align: center; font-size: 1.25rem; line-height: 1.9rem; cursor: zoom-in;
  color: #fff; background: #0009; border-radius: 4px; }
.zoom:checked + .stage { position: fixed; inset: 0; z-index: 9; overflow: auto; padding: 0.5rem;
  background: var(--paper); display: grid; align-content: safe center;
  justify-items: safe center; }
.zoom:checked + .stage > label:not(.corner), .zoom:checked + .stage .frames { width: 100%; }
.zoom:checked + .stage > label:not(.choice) { cursor: zoom-out; }
.zoom:checked + .stage img, .zoom:checked + .stage .pair {
  width: min(100%, (100vh - 5rem) * var(--w) / var(--h)); max-width: none; margin: 0 auto; }
.zoom:checked + .stage .pair img { width: 100%; }
.zoom:checked + .stage .choice { text-align: center; }
pre { overflow-x: auto; margin: 1.25rem 0; padding: 0.9rem 1.1rem; background: var(--tint);
  border-radius: 4px; font: 0.85rem/1.5 ui-monospace, Menlo, Consolas, "DejaVu Sans Mono",
  monospace; }
dl { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 0.3rem 1.75rem;
  margin: 1.25rem 0; font-size: 0.9375rem; }
dt { color: var(--soft); }
dd { margin: 0; font-variant-numeric: tabular-nums; }
@media (prefers-color-scheme: dark) { .card { padding: 0.5rem; border-radius: 4px; } }
@media (max-width: 36rem) {
  main { padding: 2rem 1rem 3rem; }
  dl { grid-template-columns: 1fr; gap: 0; } dd { margin-bottom: 0.6rem; }
  th, td { padding-right: 0.75rem; }
  tbody th, td:not(.number) { overflow-wrap: anywhere; min-width: 5.5rem; }
  .panels { grid-template-columns: repeat(var(--narrow), minmax(0, 1fr)); gap: 0.75rem; }
  .zoom:checked + .stage .drawing { width: max(100%, 46rem); }
  .adapts .zoom:checked + .stage .drawing { width: 100%; } }
@media print {
  :root { color-scheme: light; --ink: #000; --soft: #444; --line: #bbb; --paper: #fff;
    --tint: #f5f6f7; }
  main { max-width: none; padding: 0; }
  h2 { break-after: avoid; } figure, tr, dl { break-inside: avoid; }
  pre { white-space: pre-wrap; } .scroll { overflow: visible; } }
"""
