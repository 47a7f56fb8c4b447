"""Bridges that show a running controller in the tools that engineers have open already.

Each reads what the controller publishes on Zenoh and sends it on in the tool's own format; a
bridge commands nothing. Only `ilc_rt.commands.bridge` imports this package.
"""
