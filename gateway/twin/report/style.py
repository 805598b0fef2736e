"""How the report looks: light, on a screen, a phone and A4 paper. Colours after Okabe and Ito 2008, for all eyes."""

INK = "#1a1a1a"
FAINT = "#5a5f66"
LINE = "#c9ced4"
MEASURED = "#949aa1"
BEFORE = "#d55e00"
AFTER = "#0072b2"
SHADE = "#f0e442"
ACTING = "#a3357a"

CSS = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 60rem; padding: 1rem 1.25rem 3rem; background: #fff; color: #1a1a1a;
  font: 1rem/1.5 "Segoe UI", "Helvetica Neue", Arial, "Liberation Sans", sans-serif; font-variant-numeric: tabular-nums; }
header { border-bottom: 2px solid #1a1a1a; margin-bottom: 1rem; }
h1 { font-size: 1.25rem; line-height: 1.3; margin: 0 0 .3rem; overflow-wrap: anywhere; }
header p { margin: 0 0 .5rem; color: #5a5f66; font-size: .9rem; overflow-wrap: anywhere; }
h2 { font-size: 1.25rem; margin: 2.25rem 0 .5rem; padding-top: .5rem; border-top: 1px solid #c9ced4; break-after: avoid; }
h3 { font-size: 1rem; margin: 1.25rem 0 .25rem; break-after: avoid; }
p, ul { margin: .4rem 0; }
p, li, figcaption, dd { max-width: 46rem; overflow-wrap: break-word; }
figure { margin: 1rem 0; break-inside: avoid; }
figcaption { font-size: .88rem; color: #44494f; }
svg { display: block; width: 100%; height: auto; }
#gap svg { max-width: 42rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; margin: .5rem 0; font-size: .92rem; }
th, td { text-align: left; vertical-align: top; padding: .3rem .6rem .3rem 0; border-bottom: 1px solid #dde1e5; }
th { border-bottom: 1.5px solid #1a1a1a; font-weight: 600; }
tr { break-inside: avoid; }
.number { text-align: right; white-space: nowrap; padding-right: 1.4rem; }
td code { color: #5a5f66; font-size: .85em; }
.missing { color: #5a5f66; font-style: italic; }
.missing::before { content: "– "; }
code { font: .95em/1.5 "DejaVu Sans Mono", Menlo, Consolas, "Liberation Mono", monospace; }
.verdict { border: 1px solid; border-left-width: .6rem; padding: .75rem 1rem; margin: 0 0 1rem; break-inside: avoid; }
.verdict .word { font-size: .85rem; font-weight: 700; letter-spacing: .06em; text-transform: uppercase; margin: 0; }
.verdict .answer { font-size: 1.4rem; line-height: 1.3; font-weight: 600; margin: .15rem 0 .4rem; }
.verdict p, .verdict li { color: #1a1a1a; max-width: 50rem; }
.agrees { color: #00664b; background: #eef7f4; }
.found { color: #005a8d; background: #eef5fa; }
.doubt { color: #8a5a00; background: #fdf6e3; }
.unknown { color: #9c3d00; background: #fdf1ea; }
.unusable { color: #3a4047; background: repeating-linear-gradient(135deg, #f1f2f4 0 12px, #e6e8eb 12px 24px); }
.verdict .word { color: inherit; }
dl { display: grid; grid-template-columns: repeat(auto-fit, minmax(11rem, 1fr)); gap: .6rem 1.2rem; margin: .75rem 0; }
dl > div { border-left: 3px solid #c9ced4; padding-left: .6rem; break-inside: avoid; }
dt { font-size: .85rem; color: #5a5f66; }
dd { margin: 0; font-weight: 600; overflow-wrap: anywhere; }
.bar { display: block; min-width: 6rem; height: .8rem; margin-top: .3rem; background: #eef0f2; }
.bar > span { display: block; height: 100%; min-width: 2px; }
.strong { background: #0072b2; }
.weak { background: #9aa1a9; }
.models { display: grid; grid-template-columns: repeat(auto-fit, minmax(18rem, 1fr)); gap: 0 2rem; }
.models ul { list-style: none; padding: 0; }
.models li { padding: .2rem .5rem; border-left: 3px solid #dde1e5; margin-bottom: .25rem; overflow-wrap: anywhere; }
.models li.new { border-left-color: #0072b2; background: #eef5fa; }
.models .mark { font-size: .8rem; font-weight: 700; color: #005a8d; }
.tag { font-size: .8rem; font-weight: 700; white-space: nowrap; }
.bad { color: #9c3d00; }
@media (max-width: 46rem) {
  body { padding: .75rem .75rem 2rem; }
  section:not(#gap) svg { min-width: 38rem; }
  .verdict .answer { font-size: 1.2rem; }
  table { min-width: 34rem; }
}
@media print {
  @page { size: A4; margin: 14mm; }
  html { font-size: 9.5pt; }
  body { max-width: none; padding: 0; line-height: 1.4; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  .wide { overflow: visible; }
  section:not(#gap) svg, table { min-width: 0; }
  h2 { margin-top: 1.2rem; }
}
"""
