"""The web page that watches cells: `ilc dashboard`.

`model` follows the events of a cell; `cycles`, `window` and `capture` hold its signals, `status`
has its words. `fleet` holds all cells, and `feed` fills them from Zenoh. `archive`, `flight` and
`notes` read what lies beside and in libraries. `charts` turns all of it into options of ECharts.
The others are the page, and alone import NiceGUI. Imported by the command line.
"""
