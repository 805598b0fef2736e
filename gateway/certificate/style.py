"""The look of the sheet: black on white, one A4 page, nothing loaded from anywhere."""

STYLE = """
@page { size: A4 portrait; margin: 8mm 11mm; }
* { box-sizing: border-box; margin: 0; padding: 0; }
body { font: 8pt/1.23 "Liberation Sans", Arial, Helvetica, sans-serif; color: #000; background: #fff; }
main { width: 188mm; margin: 0 auto; }
@media screen { body { background: #dfe3e7; } main { background: #fff; padding: 9mm 11mm; width: 210mm; margin: 6mm auto; } }
header { display: flex; justify-content: space-between; align-items: baseline; border-bottom: .7mm solid #000; }
h1 { font-size: 15pt; }
h2 { font-size: 9.4pt; margin: 1.8mm 0 .6mm; border-bottom: .2mm solid #777; overflow-wrap: anywhere; }
.facts { display: grid; grid-template-columns: 1fr 1fr; column-gap: 6mm; margin-top: 1.6mm; }
.facts div { display: flex; min-width: 0; }
.facts .hash { grid-column: 1 / -1; }
.facts .hash dd { font-family: "Liberation Mono", monospace; }
dt { flex: none; width: 24mm; color: #444; }
dd { min-width: 0; overflow-wrap: anywhere; font-weight: bold; }
.warnings { border: .7mm solid #b00012; background: #fdeaec; margin-top: 2mm; padding: 1mm 2.5mm 1.4mm; }
.warnings h2 { color: #b00012; border: 0; margin: 0; font-size: 11pt; }
.warnings li { font-weight: bold; margin-left: 4mm; overflow-wrap: anywhere; }
.calm { margin-top: 1.5mm; color: #444; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: right; padding: .28mm 1.4mm; border-bottom: .1mm solid #bbb; font-variant-numeric: tabular-nums; }
td, thead th { white-space: nowrap; }
thead th { color: #444; font-weight: normal; vertical-align: bottom; }
th:first-child { text-align: left; overflow-wrap: anywhere; }
.budget th:first-child { width: 100%; max-width: 0; overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
.budget td:nth-child(2) { text-align: center; }
.budget tbody tr:nth-last-child(-n+2) { font-weight: bold; }
.side { display: grid; grid-template-columns: 82mm 1fr; column-gap: 6mm; }
.side > section { min-width: 0; }
.plot { display: block; width: 100%; }
.plot text { font: 8.5px "Liberation Sans", Arial, Helvetica, sans-serif; fill: #333; }
.middle { text-anchor: middle; }
.end { text-anchor: end; }
.frame { fill: none; stroke: #777; stroke-width: .8; }
.grid { stroke: #ddd; stroke-width: .6; }
.zero { stroke: #555; stroke-width: .8; }
.dm { stroke: #b00012; stroke-width: 1; stroke-dasharray: 5 3; }
.bar { stroke: #0b3d91; stroke-width: 1.3; }
.pose circle { fill: #0b3d91; stroke: #0b3d91; stroke-width: 1; }
.unused circle { fill: #fff; stroke: #b00012; }
.unused .bar { stroke: #b00012; }
p { margin-top: .7mm; overflow-wrap: anywhere; }
.missing { font-style: italic; color: #444; }
.limits ul { columns: 2; column-gap: 6mm; }
.limits li { margin-left: 3.5mm; break-inside: avoid; }
footer { margin-top: 2mm; border-top: .2mm solid #777; color: #444; }
"""
