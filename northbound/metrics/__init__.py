"""What daemons measure of themselves and of their valves, for Prometheus: read over Modbus as any observer does.

A process of its own (`positioner metrics`): no scrape ever touches a cycle's thread. `docs/interfaces.md` has them.

    command                       `positioner metrics`
    valve_metrics                 metrics of one valve, from its registers
    scraped_valve                 its registers, read when Prometheus asks
    exporter                      the metrics of several valves, served over HTTP
"""
