"""The web page that watches cells: `ilc dashboard`.

`model` and what it holds (`window`, `capture`) follow the events of cells and know neither network
nor page; `feed` fills the model from Zenoh; `archive` and `notes` read libraries; `charts` turns
both into options of ECharts; the other modules are the page, and alone import NiceGUI. Imported by
the command line.
"""
